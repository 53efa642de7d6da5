"""How far the robot of a run moves from now on, from the ground truth."""

import numpy as np

_SWING = 0.9  # [s] in which the body of a robot that braked hard rocks back and forth, by 0.1 mm


def drift(run):
    """[m] between the mean places of the robot in two swings of its body."""
    means = []
    for _ in range(2):
        moved(run, _SWING)
        means.append(np.mean(run.observer.trace.robot[-90:], axis=0)[:2])
    return float(np.hypot(*(means[1] - means[0])))


def moved(run, seconds):
    """Way [m] of the robot over some more sim time."""
    start, end = run.observer.trace.robot[-1], run.bridge.time + seconds
    run.spin_until(lambda: run.bridge.time >= end, seconds + 1.0)
    return float(np.hypot(*(run.observer.trace.robot[-1] - start)[:2]))
