"""The friction between an object and the floor, from pushes that end at once.

When the robot stops, the object slides on: with the speed v of the push, for v^2 / (2 mu g) and for
a time v / (mu g). A motion-capture frame shows some points of that slide. Between the line of the
push and the place where the object comes to rest, the slide is a parabola with one unknown, mu,
which is fitted. Quasi-static pushes show nothing of mu: it scales all forces of the floor alike.
"""

import numpy as np
from scipy.optimize import minimize_scalar

from push_estimation.intervals import TooLittle, interval_of_mean
from push_estimation.tracks import Track
from push_model.arrays import Array
from push_model.belief import Interval
from push_model.limit_surface import GRAVITY

_LINE = 0.5  # [s] of the push before the release that give its speed
_CLEAR = 0.03  # [s] about the release that belong to neither line nor rest
_SLIDE = 0.25  # [s] until the object rests at the latest
_SEEN = (-0.03, 0.1)  # [s] about the release, in which no poses may be missing
_HOLE = 0.04  # [s] between two poses
_LEAST, _MOST = 0.03, 1.5  # of mu
_SHARED = 0.02  # of mu: the time in which the robot stops


def slide(push: Track, release: float) -> float:
    """1 / mu of one push that ended at a time release [s].

    Raises
    ------
    TooLittle: too few poses, none of the slide, or the object did not move.
    """
    t = push.time - release
    line, rest = (t > -_LINE) & (t < -_CLEAR), t > _SLIDE
    if line.sum() < 10 or rest.sum() < 5:
        raise TooLittle("too few poses before or after the release")
    over = (t[1:] > _SEEN[0]) & (t[:-1] < _SEEN[1])  # steps of time that touch the slide
    if np.diff(t)[over].max() > _HOLE:
        raise TooLittle("poses are missing at the release")
    rows = np.column_stack([np.ones(int(line.sum())), t[line]])
    solved, *_ = np.linalg.lstsq(rows, push.item[line, :2], rcond=None)
    speed = float(np.hypot(*solved[1]))
    if speed < 0.02:
        raise TooLittle("the object was not pushed")
    along = solved[1] / speed
    x = (push.item[:, :2] - solved[0]) @ along
    end = float(x[rest].mean())
    shown = (t > -0.1) & (t < _SLIDE)

    def misfit(log_mu: float) -> float:
        mu = float(np.exp(log_mu))
        return float(((x[shown] - path(t[shown], speed, end, mu)) ** 2).sum())

    low, high = np.log(_LEAST), np.log(_MOST)
    grid = np.linspace(low, high, 60)
    best = int(np.argmin([misfit(g) for g in grid]))
    around = (grid[max(0, best - 1)], grid[min(len(grid) - 1, best + 1)])
    found = minimize_scalar(misfit, bounds=around, method="bounded", options={"xatol": 1e-5})
    return float(np.exp(-found.x))


def path(t: Array, speed: float, end: float, mu: float) -> Array:
    """``(n,)`` [m] places at times t of an object that moves along ``speed t`` until it begins to
    slide, and comes to rest at ``end``."""
    deceleration = mu * GRAVITY
    begin = (end - speed**2 / (2.0 * deceleration)) / speed
    late = np.clip(t - begin, 0.0, speed / deceleration)
    result: Array = speed * np.minimum(t, begin) + speed * late - 0.5 * deceleration * late**2
    return result


def floor_friction(pushes: list[tuple[Track, float]]) -> Interval:
    """mu of the floor, from pushes with the times [s] at which they ended.

    Raises
    ------
    TooLittle: fewer than three pushes can be used.
    """
    inverses = []
    for push, release in pushes:
        try:
            inverses.append(slide(push, release))
        except TooLittle:
            continue
    mean = interval_of_mean(np.array(inverses))  # the length of the slide goes with 1 / mu
    low, high = 1.0 / mean.high, 1.0 / max(mean.low, 1.0 / _MOST)
    value = 1.0 / mean.value
    return Interval(value, low - _SHARED * value, high + _SHARED * value)
