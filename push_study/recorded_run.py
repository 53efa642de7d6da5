"""A system run once in lockstep and recorded, for demonstrations and for repetition."""

from collections.abc import Mapping
from pathlib import Path

from push_bringup.job_result import JobResult
from push_bringup.monitor import Pose
from push_ros.claims import own_domain
from push_scenario.scenario import Scenario
from push_study.graph_run import LockstepRun


def recorded_run(
    scenario: Scenario,
    system: str,
    bag: Path,
    goals: Mapping[str, Pose] | None = None,
    sim_limit: float = 300.0,
    namespace: str = "",
) -> dict[str, JobResult]:
    """Send goals to the teams, wait until their jobs end, record everything.

    Parameters
    ----------
    goals: by team; those of the scenario where they are not given. sim_limit: [s] of simulation.
    bag: folder that must not exist. ``planar-push rerun`` repeats it to the bit.
    """
    with (
        own_domain(),
        LockstepRun(scenario, quiet=True, system=system, namespace=namespace, record=bag) as run,
    ):
        run.start()
        return run.reach_all(goals, sim_limit)
