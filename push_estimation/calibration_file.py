"""The file of a calibration: YAML for people, and for ``planar-push belief --from``."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from push_estimation.calibration_runs import Calibration
from push_model import se2
from push_model.arrays import Array
from push_model.belief import QUANTITIES, BeliefError, Interval
from push_model.unique_keys import UniqueKeysLoader

_HEAD = """# Written by planar-push calibrate.
# values: planar-push belief --from THIS_FILE tells them to a running suite.
# robots: copy offset into lab.bodies of the scenario, and bumper_distance into the robot's bumper.
"""


def contents(found: Calibration, robot: str, item: str, offset: Array) -> dict[str, Any]:
    """What the file holds. offset: ``(3,)`` of the marker frame that was assumed."""
    values = {}
    for name, interval in (("floor_friction", found.floor), ("contact_friction", found.contact)):
        if interval is not None:
            values[f"{item}.{name}"] = _plain(_clipped(interval, name))
    own: dict[str, Any] = {}
    if found.axle is not None:
        new = se2.compose(se2.inverse(found.frame), offset)
        own["offset"] = [round(float(v), 6) for v in new]
        own["offset_half_width"] = [round(0.5 * i.width, 6) for i in found.axle]
    if found.distance is not None:
        own["bumper_distance"] = _plain(found.distance)
    return {
        "source": "calibration",
        "values": values,
        "robots": {robot: own},
        "not_found": list(found.troubles),
    }


def write(path: Path, values: Mapping[str, Any]) -> None:
    """Write the file."""
    path.write_text(_HEAD + yaml.safe_dump(dict(values), sort_keys=False), encoding="utf-8")


def read_values(path: Path) -> tuple[str, dict[tuple[str, str], Interval]]:
    """Source, and intervals by body and quantity, of a file.

    Raises
    ------
    BeliefError: it cannot be read, or a value is none.
    """
    try:
        data = yaml.load(path.read_text(encoding="utf-8"), Loader=UniqueKeysLoader)
        found = {}
        for name, numbers in data["values"].items():
            body, _, quantity = str(name).rpartition(".")
            if quantity not in QUANTITIES:
                raise BeliefError(f"{path}: unknown quantity '{quantity}' of '{body}'")
            ends = (float(numbers[k]) for k in ("value", "low", "high"))
            found[body, quantity] = Interval(*ends)
        return str(data.get("source") or "calibration"), found
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise BeliefError(f"{path}: cannot be read: {error}") from None
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        if isinstance(error, BeliefError):
            raise
        raise BeliefError(
            f"{path}: expected 'values' with BODY.QUANTITY: {{value, low, high}}; {error!r}"
        ) from None


def _clipped(interval: Interval, quantity: str) -> Interval:
    """Within the range of a quantity."""
    q = QUANTITIES[quantity]
    ends = (min(max(v, q.low), q.high) for v in (interval.value, interval.low, interval.high))
    return Interval(*ends)


def _plain(interval: Interval) -> dict[str, float]:
    return {k: round(float(getattr(interval, k)), 6) for k in ("value", "low", "high")}
