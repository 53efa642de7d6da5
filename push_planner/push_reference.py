"""Time along pushes: the reference of one push, and of pushes in a row on the same side."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive
from push_model.push_segment import PushSegment
from push_model.trajectory import Trajectory, along_curve
from push_planner.push_curve import PushCurve
from push_planner.push_plan import PlanError, PlanningFailed
from push_planner.settings import PlannerSettings

_OFF = 1e-3  # [m], [rad] between the end of a push and where it goes on
_MOVING = 1e-3  # [m/s] of a sample that has a curvature
_SPACING = 0.005  # [m] of samples
_SAMPLES = 20  # of a curve, at least


def push_reference(
    curves: Sequence[PushCurve], drive: DifferentialDrive, settings: PlannerSettings
) -> Trajectory:
    """Rest to rest along curves, each of which begins where the one before ends.

    The speed at each curvature is the greatest that ``push_speed`` and the wheels, less their
    reserve, allow. Where the curvature jumps from one curve to the next, the robot does not stop.
    """
    return _along([_of_curve(curve) for curve in curves], drive, settings)


def _of_curve(curve: PushCurve) -> Array:
    """``(n, 4)`` x, y [m], heading [rad] and curvature [1/m] of a curve."""
    return np.column_stack(curve.sample(max(_SAMPLES, int(curve.length / _SPACING))))


def _of_trajectory(trajectory: Trajectory) -> Array:
    """The same of a push that has a reference already."""
    v, omega = trajectory.twist.T
    moving = np.flatnonzero(v > _MOVING)
    time = trajectory.time
    curvature = np.interp(time, time[moving], omega[moving] / v[moving])
    return np.column_stack([trajectory.pose, curvature])


def _along(
    parts: Sequence[Array], drive: DifferentialDrive, settings: PlannerSettings
) -> Trajectory:
    """Rest to rest along paths ``(n, 4)``, each of which begins where the one before ends."""
    x, y, heading, curvature = np.vstack([parts[0], *(part[1:] for part in parts[1:])]).T
    return along_curve(
        np.column_stack([x, y]),
        np.unwrap(heading),
        curvature,
        drive,
        settings.push_speed,
        settings.push_acceleration,
        settings.wheel_reserve,
    )


def joined(
    segments: Sequence[PushSegment], drive: DifferentialDrive, settings: PlannerSettings
) -> tuple[PushSegment, ...]:
    """Pushes as they are carried out: those in a row on the same side become one without a stop."""
    result = []
    for _, group in groupby(segments, key=lambda segment: (segment.side, segment.turns)):
        run = list(group)
        if len(run) == 1:
            result.append(run[0])
            continue
        curves = [PushCurve(s.robot_start, s.robot_end, s.k_start, s.k_end, s.length) for s in run]
        result.append(_merged(run, push_reference(curves, drive, settings)))
    return tuple(result)


def _merged(run: Sequence[PushSegment], trajectory: Trajectory) -> PushSegment:
    """Pushes in a row on the same side as one, along a trajectory."""
    first, last = run[0], run[-1]
    return replace(
        first,
        object_end=last.object_end,
        robot_end=last.robot_end,
        k_end=last.k_end,
        length=sum(s.length for s in run),
        clearance=min(s.clearance for s in run),
        trajectory=trajectory,
    )


def check_under_way(push: PushSegment, start: Array) -> None:
    """Raise PlanningFailed unless a plan that begins with the object at ``(3,)`` can go on from the
    end of a push."""
    off = se2.between(start, push.object_end)
    if np.hypot(off[0], off[1]) > _OFF or abs(off[2]) > _OFF:
        raise PlanningFailed(
            PlanError.INVALID_GOAL, "the push under way must end where the plan starts"
        )
    if push.turns or push.trajectory.twist[:, 0].max() <= _MOVING:
        raise PlanningFailed(
            PlanError.INVALID_GOAL, "the push under way must move forward, and not on a corner"
        )


def going_on(
    under_way: PushSegment,
    segments: Sequence[PushSegment],
    drive: DifferentialDrive,
    settings: PlannerSettings,
) -> tuple[PushSegment, ...]:
    """A push that is under way, and after it pushes of a plan that begins where it ends.

    Where the plan goes on on the same side, its first push and the one under way become one without
    a stop. Otherwise the one under way comes to rest at its end.

    segments: as they are carried out, see ``joined``.
    """
    first, begun = segments[0], _of_trajectory(under_way.trajectory)
    if first.side != under_way.side or first.turns:
        head = replace(under_way, trajectory=_along([begun], drive, settings))
        return head, *segments
    way = _along([begun, _of_trajectory(first.trajectory)], drive, settings)
    return _merged([under_way, first], way), *segments[1:]
