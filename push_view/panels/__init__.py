"""What the page and the report show of a job, a file a system: single, group, swarm.

A module of this package is the panel of the system that it is named after: its ``PANEL``. A system
without one gets the state, the map and the log, which all have.
"""

import importlib
import pkgutil
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, cast

from push_ros.names import Names

if TYPE_CHECKING:
    from push_view.contents import BagContents, Job


class LivePanel(Protocol):
    """Numbers of a job under way."""

    def rows(self) -> list[tuple[str, str]]:
        """What it is, and its value with a unit."""
        ...

    def close(self) -> None:
        """Leave the graph."""
        ...


class Panel(Protocol):
    """Of one system."""

    def live(self, node: Any, names: Names, robots: Sequence[str]) -> LivePanel:
        """For the page: subscribe to what the robots of a team tell."""
        ...

    def draw(self, figure: Any, grid: Any, contents: "BagContents", job: "Job") -> None:
        """For the report: draw into a part of a matplotlib figure (a SubplotSpec)."""
        ...


def panel_of(system: str) -> Panel | None:
    """The panel of a system; None where it has none."""
    if system not in {module.name for module in pkgutil.iter_modules(__path__)}:
        return None
    return cast(Panel, importlib.import_module(f"{__name__}.{system}").PANEL)
