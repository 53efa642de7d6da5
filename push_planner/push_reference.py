"""Time along pushes: the reference of one push, and of pushes in a row on the same side."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive
from push_model.push_segment import PushSegment
from push_model.trajectory import Trajectory, along_curve
from push_planner.push_curve import PushCurve
from push_planner.settings import PlannerSettings

_SPACING = 0.005  # [m] of samples
_SAMPLES = 20  # of a curve, at least


def push_reference(
    curves: Sequence[PushCurve], drive: DifferentialDrive, settings: PlannerSettings
) -> Trajectory:
    """Rest to rest along curves, each of which begins where the one before ends.

    The speed at each curvature is the greatest that ``push_speed`` and the wheels, less their
    reserve, allow. Where the curvature jumps from one curve to the next, the robot does not stop.
    """
    points: list[Array] = []
    heading: list[Array] = []
    curvature: list[Array] = []
    for curve in curves:
        p, h, k = curve.sample(max(_SAMPLES, int(curve.length / _SPACING)))
        first = 1 if points else 0
        points.append(p[first:])
        heading.append(h[first:])
        curvature.append(k[first:])
    return along_curve(
        np.vstack(points),
        np.unwrap(np.concatenate(heading)),
        np.concatenate(curvature),
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
        first, last = run[0], run[-1]
        curves = [PushCurve(s.robot_start, s.robot_end, s.k_start, s.k_end, s.length) for s in run]
        result.append(
            replace(
                first,
                object_end=last.object_end,
                robot_end=last.robot_end,
                k_end=last.k_end,
                length=sum(s.length for s in run),
                clearance=min(s.clearance for s in run),
                trajectory=push_reference(curves, drive, settings),
            )
        )
    return tuple(result)
