"""Two teams at once, recorded, with events by callback; then what the bag says."""

import sys
import tempfile
from pathlib import Path

from push_bringup.job_result import JobEvent
from push_bringup.suite import Suite
from push_record.contents import load_contents


def tell(event: JobEvent) -> None:
    """Called while the suite is waited for."""
    print(f"{event.stamp:6.2f} s  {event.team:6s} {event.state:12s} {event.reason}")


def main(factor: float = 1.0) -> bool:
    """Whether both boxes got to their goals."""
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        with Suite("two-singles", record=bag, factor=factor, on_event=tell) as suite:
            results = suite.reach_all()
        contents = load_contents(bag)
    for name, result in results.items():
        print(result, f"by the ground truth: {1e3 * contents.final_error(name)[0]:.1f} mm")
    return all(r.success for r in results.values())


if __name__ == "__main__":
    sys.exit(not main(*map(float, sys.argv[1:])))
