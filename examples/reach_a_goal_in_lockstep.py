"""The same in lockstep: all nodes in this process, as fast as possible, repeatable to the bit."""

import sys

from push_scenario.scenario import load_scenario
from push_study.graph_run import LockstepRun


def main() -> bool:
    """Whether the box reached the pose."""
    scenario = load_scenario("short").settings("planner", push_speed=0.06)
    with LockstepRun(scenario, quiet=True) as run:
        run.start()
        (result,) = run.reach_all().values()
    print(result)
    return result.success


if __name__ == "__main__":
    sys.exit(not main())
