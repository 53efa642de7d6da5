"""MuJoCo's opinion of the laws of friction and of pushes, where it is installed."""

import math

import numpy as np
import pytest

pytest.importorskip("mujoco")

from benchmarks import third_opinion as mj
from push_scenario.bodies import load_object

BOX = load_object("box9")


def test_a_sliding_box_slows_down_by_mu_g_in_every_direction():
    for direction in np.arange(6) * math.pi / 3:
        along, aside = mj.deceleration(BOX, 0.3, direction)
        assert along == pytest.approx(1.0, abs=0.05) and abs(aside) < 0.02
    assert mj.spin(BOX, 0.3) == pytest.approx(1.0, abs=0.05)


def test_a_box_that_nobody_pushes_stays():
    world = mj.MujocoWorld(BOX, mj.nowhere(0.4))
    world.advance(1.0)
    assert world.box == pytest.approx([0.0, 0.0, 0.4], abs=1e-4)


def test_pushes_end_about_where_the_other_worlds_end_them():
    """Six pushes of 10 cm; the limit surfaces of four feet and of the planar world differ."""
    pushes = mj.pushes(BOX, 6)
    ends = {k: [mj.pushed(k, BOX, p) for p in pushes] for k in ("planar", "pybullet", "mujoco")}
    for other in ("planar", "pybullet"):
        away, turned = mj.parted(ends[other], ends["mujoco"])
        assert np.median(away) < 5.0 and np.median(turned) < 0.12
    moved, _ = mj.parted([p.box for p in pushes], ends["mujoco"])
    assert np.median(moved) > 40.0
