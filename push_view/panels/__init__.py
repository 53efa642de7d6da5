"""Panels of a job on the page and in the report, one file per system: single, group, swarm.

The ``PANEL`` of a module of this package belongs to the system of that name. A system without a
panel shows state, map and log, as all do.
"""

import importlib
import pkgutil
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, cast

from push_ros.names import Names

if TYPE_CHECKING:
    from push_record.contents import BagContents, Job


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
