"""What is believed of objects, robots and the pose stream, as rows for the page."""

from typing import Any

from push_model.belief import POSES, QUANTITIES, Belief
from push_msgs.msg import Belief as BeliefMessage
from push_ros.belief_feed import belief_of
from push_ros.report_conversions import belief_from_ros
from push_scenario.scenario import Scenario
from push_view.page_data import short

_MOST = 20  # objects that are listed


class BeliefTable:
    """The scenario's values, and what sources said since."""

    def __init__(self, scenario: Scenario) -> None:
        self._base = self.current = belief_of(scenario)
        self._said: dict[str, BeliefMessage] = {}
        self._sources: dict[tuple[str, str], str] = {}

    def take(self, message: BeliefMessage) -> None:
        """A source replaces what it said before.

        Raises
        ------
        InvalidMessage: it is not a belief about these bodies.
        """
        said = {**self._said, message.source: message}
        belief: Belief = self._base
        sources: dict[tuple[str, str], str] = {}
        for each in said.values():
            belief = belief_from_ros(each, belief)
            pairs = zip(each.bodies, each.quantities, strict=True)
            sources |= dict.fromkeys(((str(b), str(q)) for b, q in pairs), str(each.source))
        self._said, self.current, self._sources = said, belief, sources

    def as_json(self) -> list[dict[str, Any]]:
        """body, quantity, unit, value, low, high, source of each row, in SI units."""
        kinds = dict.fromkeys([(n, "object") for n in list(self._base.objects)[:_MOST]])
        rows = []
        for body, kind in kinds:
            rows += [self._row(body, q) for q, spec in QUANTITIES.items() if spec.kind == kind]
        shown = {(r["body"], r["quantity"]) for r in rows}
        more = [key for key in self.current.values if key not in shown]
        if (POSES, "latency") not in more:
            more.append((POSES, "latency"))
        return rows + [self._row(*key) for key in more]

    def _row(self, body: str, quantity: str) -> dict[str, Any]:
        interval = self.current.interval(body, quantity)
        return {
            "body": body or "poses",
            "quantity": quantity,
            "unit": QUANTITIES[quantity].unit,
            "value": short(interval.value, 4),
            "low": short(interval.low, 4),
            "high": short(interval.high, 4),
            "source": self._sources.get((body, quantity), "scenario"),
        }
