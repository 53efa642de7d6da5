"""Where the time of a job of one robot goes, and the least that its path takes."""

from collections.abc import Sequence

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive
from push_study.observer import Trace
from push_study.pool import Row

STATES = ("PLANNING", "POSITIONING", "APPROACH", "PUSHING", "DETACHING")
"""Of a job, in the order of the state machine."""

_EVERY = 10  # frames of the ground truth between two poses of a path
_NONE = np.zeros((0, 3))


def path(trace: Trace) -> Array:
    """Poses ``(n, 3)`` of the robot in the ground truth, every 0.1 s and at the end."""
    poses = [*trace.robot[::_EVERY], *trace.robot[-1:]]
    return np.array(poses) if poses else _NONE


def path_length(poses: Array) -> float:
    """[m] that the axle midpoint travels, forward and backward."""
    return float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())


def shortest_time(poses: Array, drive: DifferentialDrive) -> float:
    """[s] in which a robot can drive a path ``(n, 3)`` if its faster wheel is always at the limit.

    Between two poses the axle midpoint moves by ds and the heading turns by dtheta. The faster
    wheel then rolls |ds| + half_track |dtheta|. The result is the sum over the path, divided by the
    maximum speed of a wheel. Accelerations take no time, and nothing is waited for. No robot with
    these wheels drives the path in less time.
    """
    turns = np.abs([se2.wrap(float(turn)) for turn in np.diff(poses[:, 2])]).sum()
    return (path_length(poses) + drive.half_track * float(turns)) / drive.max_speed


def time_by_state(states: Sequence[tuple[float, str, str, int]]) -> dict[str, float]:
    """[s] that a job was in each of ``STATES``. states: of a trace; the last one ends the job."""
    spent = dict.fromkeys(STATES, 0.0)
    for (begin, name, *_), (end, *_) in zip(states, states[1:], strict=False):
        if name in spent:
            spent[name] += end - begin
    return spent


def job_times(trace: Trace, drive: DifferentialDrive, planning: float) -> Row:
    """Measures of a job: its time, also by state, the path of the robot and its shortest time.

    planning: [s] CPU time of all plans. In a simulated run two slices of a plan take one period
    of the poses, whatever their CPU time. In ``charged_s`` planning takes its CPU time, if that is
    more.
    """
    spent, poses = time_by_state(trace.states), path(trace)
    total, least = sum(spent.values()), shortest_time(poses, drive)
    charged = total + max(0.0, planning - spent["PLANNING"])
    return {
        "job_time_s": total,
        "path_length_m": path_length(poses),
        "shortest_time_s": least,
        "planning_cpu_s": planning,
        "charged_s": charged,
        "time_ratio": total / least if least > 0.0 else float("nan"),
        "charged_ratio": charged / least if least > 0.0 else float("nan"),
        **{f"{name.lower()}_s": value for name, value in spent.items()},
    }
