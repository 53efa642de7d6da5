"""Two teams at once, recorded, with events by callback; then read the bag."""

import sys
import tempfile
from pathlib import Path

from push_bringup.job_result import JobEvent
from push_bringup.suite import Suite
from push_record.contents import load
from push_view.report import final_error


def tell(event: JobEvent) -> None:
    """Called while the script waits for the suite."""
    print(f"{event.stamp:6.2f} s  {event.team:6s} {event.state:12s} {event.reason}")


def main(factor: float = 1.0) -> bool:
    """Whether both boxes reached their goals."""
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        with Suite("two-singles", record=bag, factor=factor, on_event=tell) as suite:
            results = suite.reach_all()
        contents = load(bag)
    for name, result in results.items():
        truth = final_error(contents, contents.jobs[f"/{name}/"])
        print(result, f"by the ground truth: {truth}")
    return all(r.success for r in results.values())


if __name__ == "__main__":
    sys.exit(not main(*map(float, sys.argv[1:])))
