"""Start a suite, one process per node, and bring a box to a pose, in real time or faster."""

import sys

from push_bringup.suite import Suite


def main(factor: float = 1.0) -> bool:
    """Whether the box reached the pose."""
    slowly = {"planner": {"push_speed": 0.06}}
    with Suite("short", parameters=slowly, factor=factor) as suite:
        result = suite.reach(0.1, 0.04, 0.1)
    print(result)
    return result.success


if __name__ == "__main__":
    sys.exit(not main(*map(float, sys.argv[1:])))
