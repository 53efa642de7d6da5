"""Row 22 of the table of faults, for group and swarm: a goal that does not fit, in mid-job.

The goal puts the plate upon a pillar that its outline does not touch. Public topics only.
"""

import math

import numpy as np
import pytest

from push_model.jobs import JobError
from push_msgs.msg import JobState
from push_scenario.scenario import scenario_from_mapping
from push_study.graph_run import LockstepRun
from tests.samples import mostly_long

PILLAR, RADIUS = (0.9, -0.6), 0.15
PLATE = {
    "type": {
        "shape": {"rectangle": {"length": 0.5, "width": 0.35}},
        "mass": 0.3,
        "height": 0.02,
        "floor_friction": 0.6,
        "contact_friction": 0.2,
    },
    "start": [-0.4, 0.4, 0.0],
}
GOAL = np.array([0.2, 0.6, 0.2])
UPON = [(*PILLAR, 0.0), (*PILLAR, 1.1)]  # the outline is 2.5 cm and more from the pillar


def scenario(system):
    count = 3 if system == "group" else 8
    robots = {
        "e": {
            "type": "epuck_ring",
            "count": count,
            "placement": {"random": {"seed": 2, "gap": 0.03, "area": [-1.6, -0.8, -1.2, 1.2]}},
        }
    }
    values = {
        "environment": {
            "size": [3.6, 2.8],
            "circles": [{"centre": list(PILLAR), "radius": RADIUS}],
        },
        "robots": robots,
        "objects": {"plate": PLATE},
        "goal": GOAL.tolist(),
        "parameters": {"bridge": {"world": "planar"}},
    }
    return scenario_from_mapping(values, "pillar", "test")


@pytest.mark.parametrize("system", mostly_long(["group", "swarm"], 0))
def test_a_goal_upon_a_pillar_is_refused_and_the_job_does_not_notice(system):
    with LockstepRun(scenario(system), system=system, quiet=True) as run:
        run.start()
        run.teams[""].send_goal(GOAL)

        def state():
            return run.observer.state

        assert run.spin_until(lambda: state().state == JobState.PUSHING, 120.0)
        job = state().job
        for k, upon in enumerate(UPON):
            before = state().refusals
            run.observer.send_goal(np.array(upon))
            assert run.spin_until(lambda before=before: state().refusals > before, 5.0), k
            assert state().refusal_code == JobError.GOAL_OCCUPIED and state().refusal
            assert state().job == job and state().state != JobState.IDLE
        assert run.spin_until(lambda: state().state == JobState.IDLE, 400.0)
        assert state().job == job and state().error_code == 0, state().reason
        off = run.observer.trace.object[-1] - GOAL
        assert np.hypot(*off[:2]) < 0.03
        assert abs(math.remainder(float(off[2]), 2.0 * math.pi)) < 0.06
