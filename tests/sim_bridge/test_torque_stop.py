"""How a robot on torques stops where there is no solution: three ways, in the simulation."""

import numpy as np
import pytest

from push_model import se2
from push_model.specs import EnvironmentSpec
from push_model.torque_robot import TorqueRobot
from push_mpc.torque_brake import at_rest, braking_torques
from push_scenario.scenario import load_scenario
from sim_bridge.pybullet_world import PyBulletWorld
from sim_bridge.settings import PhysicsSettings

PIONEER = next(iter(load_scenario("pioneer").robots.values()))[0]
ROBOT = TorqueRobot.of(PIONEER)
OPEN = EnvironmentSpec((30.0, 30.0), resolution=0.1)
TICK = 10  # steps of 1 ms


class Driven:
    """The Pioneer under torques that are chosen every 10 ms from its true speed."""

    def __init__(self, world):
        self.world = world
        world.reset()
        world.step(200)
        self.v = self.omega = self.aside = 0.0
        self.slip = []

    def step(self, torques):
        """torques: right, left; None: locked wheels."""
        if torques is None:
            self.world.command("p", 0.0, 0.0)
        else:
            self.world.command_torques("p", torques[1], torques[0])
        before = self.world.poses()["p"]
        self.world.step(TICK)
        after = self.world.poses()["p"]
        moved = se2.between(before, after)
        self.v, self.omega = moved[0] / 0.01, moved[2] / 0.01
        self.aside = moved[1] / 0.01 - 0.5 * self.v * moved[2]
        axle = self.v + self.omega * ROBOT.half_track * np.array([-1.0, 1.0])
        self.slip.append(self.world.wheel_state("p").speed * ROBOT.radius - axle)
        return after

    def reach(self, v, omega):
        """Drive at a speed and a turn rate, gently; forget the slip of getting there."""
        for k in range(250):
            want = v * min(1.0, k / 120), omega * min(1.0, max(0.0, (k - 120) / 120))
            a, eps = 8.0 * (want[0] - self.v), 8.0 * (want[1] - self.omega)
            self.step(ROBOT.torques(self.v, self.omega, np.clip(a, -1, 1), np.clip(eps, -2, 2)))
        assert (self.v, self.omega) == pytest.approx((v, omega), abs=0.03)
        self.slip.clear()


def stop(world, v, omega, how):
    """Way [m], turn beyond the arc [rad], greatest slip [m/s] and time [s] until at rest."""
    robot = Driven(world)
    robot.reach(v, omega)
    start, way, turn = world.poses()["p"], 0.0, 0.0
    for _ in range(150):
        if abs(robot.v) < 0.01 and abs(robot.omega) < 0.05:
            break
        if how == "locked" or (how == "braked" and at_rest(robot.v, robot.omega)):
            torques = None
        elif how == "braked":
            torques = braking_torques(ROBOT, robot.v, robot.omega, 0.45, 5.0, share=0.5)
        else:
            torques = (0.0, 0.0)
        pose = robot.step(torques)
        way += float(np.hypot(*(pose - start)[:2]))
        turn += float(se2.wrap(float(pose[2] - start[2])))
        start = pose
    arc = omega / v * way  # on which it was
    rolling = np.abs(np.array(robot.slip[:-3])).max()
    return way, turn - arc, float(rolling), 0.01 * len(robot.slip)


def test_braking_within_the_traction_stops_soon_and_holds_the_arc():
    """From 0.8 m/s in a bend: beside it, locked wheels skid off the arc and free ones roll on."""
    omega = 0.64
    with PyBulletWorld(OPEN, {"p": (PIONEER, np.zeros(3))}, {}, PhysicsSettings()) as world:
        found = {how: stop(world, 0.8, omega, how) for how in ("braked", "locked", "coasting")}
    # the least way of 0.8 m/s: both wheels carry the braking force at mu = 0.5
    carried = ROBOT.loads(0.0, 0.0, 0.0, 0.0)[:2].sum()
    least = 0.8**2 / (2.0 * 0.5 * carried / ROBOT.mass)
    way, turn, slip, _ = found["braked"]
    assert slip < 0.03 and abs(turn) < 0.05
    assert 0.7 * least < way < 1.5 * least
    assert found["locked"][2] > 0.5  # the wheels skid from the first moment on
    assert found["coasting"][3] > 1.4 and found["coasting"][0] > 2.0 * way  # it does not stop
    assert abs(found["coasting"][1]) > 0.3  # and turns ever tighter
    assert abs(found["locked"][1]) > 2.0 * abs(turn)


def test_what_slips_already_brakes_with_what_is_left():
    """Beyond the traction whatever it does: finite torques within the motors' limit."""
    for v, omega in ((1.0, 4.0), (-0.8, 3.0), (0.2, 0.0), (0.0, 2.0)):
        right, left = braking_torques(ROBOT, v, omega, 0.5, 5.0, (8.0, -1.0))
        assert np.isfinite([right, left]).all() and max(abs(right), abs(left)) <= 5.0
        assert v * (right + left - 0.8 * ROBOT.radius) <= 1e-6 or omega != 0.0


def test_two_wheels_bear_the_sideways_traction_between_them():
    """Circles at 0.8 m/s. One is beyond (2.31)-(2.32) as printed, but within them when each wheel
    bears a half: the wheels roll. One is beyond both: they slip."""
    with PyBulletWorld(OPEN, {"p": (PIONEER, np.zeros(3))}, {}, PhysicsSettings()) as world:
        for omega, slips in ((0.95, False), (1.3, True)):
            torques = ROBOT.torques(0.8, omega, 0.0, 0.0)
            printed = ROBOT.slip_margins(0.8, omega, *torques, 0.5).min()
            shared = ROBOT.slip_margins(0.8, omega, *torques, 0.5, share=0.5).min()
            assert printed < -2.5 and ((shared < -1.5) if slips else (shared > 2.0))
            robot, aside = Driven(world), []
            for k in range(500):
                want = 0.8 * min(1.0, k / 120), omega * min(1.0, max(0.0, (k - 120) / 200))
                a, eps = 3.0 * (want[0] - robot.v), 3.0 * (want[1] - robot.omega)
                a, eps = np.clip(a, -0.5, 0.5), np.clip(eps, -1.0, 1.0)
                robot.step(ROBOT.torques(robot.v, robot.omega, a, eps))
                aside.append(abs(robot.aside))
            slip = float(np.abs(np.array(robot.slip))[330:].max())
            assert (slip > 0.2 and max(aside) > 0.05) if slips else (slip < 0.02), slip
            assert slips or max(aside) < 0.01
