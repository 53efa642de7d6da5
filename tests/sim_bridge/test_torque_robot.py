"""The model of section 2.3.1 against the simulation: motion, and what each wheel carries."""

from dataclasses import replace

import numpy as np
import pybullet as pb
import pytest

from push_model.specs import EnvironmentSpec
from push_model.torque_robot import TorqueRobot
from push_scenario.scenario import load_scenario
from sim_bridge.pybullet_world import PyBulletWorld
from sim_bridge.robot_body import WHEELS
from sim_bridge.settings import PhysicsSettings

PIONEER = next(iter(load_scenario("pioneer").robots.values()))[0]
GRIPPY = replace(PIONEER, drive=replace(PIONEER.drive, wheel_friction=2.0))
OPEN = EnvironmentSpec((30.0, 30.0), resolution=0.1)
STEP = 1e-3


def loads_in(world, body):
    """[N] right, left, caster."""
    found = np.zeros(3)
    for contact in pb.getContactPoints(bodyA=body, physicsClientId=world._client):
        link = contact[3]
        found[{WHEELS[1]: 0, WHEELS[0]: 1}.get(link, 2)] += contact[9]
    return found


def test_motion_and_loads_are_those_of_the_simulation():
    """Random torques, wheels that grip. The printed (2.27) takes h - r as the lever of what pitches
    the robot; with it the wheels' load would be off by up to 12 N here."""
    robot = TorqueRobot.of(GRIPPY)
    random = np.random.default_rng(0)
    with PyBulletWorld(OPEN, {"p": (GRIPPY, np.zeros(3))}, {}, PhysicsSettings()) as world:
        for _ in range(12):
            world.reset()
            world.step(200)
            right, left = random.uniform(-1.0, 1.5, 2)
            q = np.zeros(5)
            world.command_torques("p", left, right)
            loads = []
            for k in range(400):
                world.step(1)
                if k >= 350:
                    loads.append(loads_in(world, world._wheeled["p"].body))
                a, eps = robot.accelerations(q[3], q[4], right, left)
                rate = [np.cos(q[2]) * q[3], np.sin(q[2]) * q[3], q[4], a, eps]
                q = q + STEP * np.array(rate)
            speed = world.wheel_state("p").speed * robot.radius
            assert speed.mean() == pytest.approx(q[3], abs=2e-3)
            turn = (speed[1] - speed[0]) / (2.0 * robot.half_track)
            assert turn == pytest.approx(q[4], abs=5e-3)
            assert world.poses()["p"] == pytest.approx(q[:3], abs=4e-3)
            carried = robot.loads(q[3], q[4], right, left)
            assert np.mean(loads, axis=0) == pytest.approx(carried, abs=0.8)
            printed = robot.body_mass * (robot.height - robot.radius) * a / robot.caster
            ours = robot.body_mass * robot.height * a / robot.caster
            if abs(a) > 0.8:
                assert abs(ours - printed) > 4.0


@pytest.mark.parametrize("friction", [0.3, 0.5, 0.7])
def test_wheels_slip_where_the_model_says_so(friction):
    """Straight on, from rest: below the limit they roll, above it they spin."""
    spec = replace(PIONEER, drive=replace(PIONEER.drive, wheel_friction=friction))
    robot = TorqueRobot.of(spec)
    torques = np.linspace(0.01, 4.0, 4000)
    margins = [robot.slip_margins(0.0, 0.0, t, t, friction).min() for t in torques]
    limit = float(torques[np.argmin(np.abs(margins))])
    with PyBulletWorld(OPEN, {"p": (spec, np.zeros(3))}, {}, PhysicsSettings()) as world:
        for part, slips in ((0.9, False), (1.15, True)):
            world.reset()
            world.step(200)
            world.command_torques("p", part * limit, part * limit)
            world.step(500)
            before = world.poses()["p"][0]
            world.step(20)
            axle = (world.poses()["p"][0] - before) / 0.02
            slip = float(world.wheel_state("p").speed.mean() * robot.radius - axle)
            assert (slip > 0.05) == slips, (part, slip)
