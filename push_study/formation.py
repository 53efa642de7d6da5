"""Discs that push an object as one rigid formation, in any world: the simulation of 3.1.4."""

from dataclasses import dataclass, replace

import numpy as np

from grasp_opt.contact_outline import Contacts
from grasp_opt.metrics import displacement, energy
from grasp_opt.object_trajectory import ObjectTrajectory
from push_model import se2
from push_model.arrays import Array
from push_model.bumpers import RingBumper
from push_model.drives import HolonomicDrive
from push_model.outlines import distance, inside
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.bodies import load_robot
from sim_bridge.world import World
from sim_bridge.worlds import world_kind

_TICK = 0.02  # [s] between velocity commands
_STRONG = 60.0  # [N] of a pusher's traction: it goes where it is told
_TOUCH = 1e-4  # [m] between pusher and object at the beginning
_KEPT = 2e-3  # [m] up to which a contact counts as kept
_TRANSPORTED = 0.01  # [m] from its trajectory up to which an object counts as transported along it
_MARGIN = 0.8  # [m] about the trajectory


@dataclass(frozen=True)
class FormationPush:
    """What became of a push.

    displacement: delta of (3.2), over the length of the trajectory. energy: E of (3.3) [N].
    success: whether every pusher kept its contact, from half a second on, and the object its
    trajectory. widest: [m] greatest gap then. astray: [m] greatest distance from where the object
    was to be. position, orientation: [m], [rad] of it at the end. objects ``(t, 3)``, agents ``(t,
    n, 2)``; forces ``(t - 1, n, 2)`` [N] on the object.
    """

    displacement: float
    energy: float
    success: bool
    widest: float
    astray: float
    position: float
    orientation: float
    objects: Array
    agents: Array
    forces: Array


def pusher(radius: float) -> RobotSpec:
    """A disc of a radius [m] that moves as it is told."""
    disc = load_robot("disc")
    assert isinstance(disc.drive, HolonomicDrive) and isinstance(disc.bumper, RingBumper)
    return replace(
        disc,
        body_radius=min(disc.body_radius, radius),
        bumper=replace(disc.bumper, radius=radius),
        drive=replace(disc.drive, max_force=_STRONG, max_speed=1.0),
    )


def push(
    item: ObjectSpec,
    contacts: Contacts,
    trajectory: ObjectTrajectory,
    radius: float,
    world: str = "pybullet",
) -> FormationPush:
    """Push an object along a trajectory with discs at its contacts, without any feedback.

    contacts, trajectory: about the centre of mass. radius: [m] of the discs. world: its kind.
    """
    low, high = trajectory.pose[:, :2].min(axis=0), trajectory.pose[:, :2].max(axis=0)
    size = 2.0 * (np.maximum(np.abs(low), np.abs(high)) + _MARGIN)
    room = EnvironmentSpec((float(size[0]), float(size[1])), resolution=0.05)
    local = contacts.centres(radius + _TOUCH)
    places = contacts.centres(radius)
    start = trajectory.pose[0]
    names = [f"d{i}" for i in range(len(local))]
    disc = pusher(radius)
    at_start = se2.transform(start, local)
    robots = {n: (disc, np.array([*p, 0.0])) for n, p in zip(names, at_start, strict=True)}
    kind = world_kind(world)
    objects, agents, forces, widest, astray = [start], [at_start], [], 0.0, 0.0
    bodies = {"object": (item, item.geometric_pose(start))}
    running = kind.make(room, robots, bodies, kind.settings(), _TICK)
    try:
        steps = round(_TICK / running.time_step)
        for tick in range(1, int(np.ceil(trajectory.duration / _TICK)) + 1):
            before, after = (trajectory.sample((tick - back) * _TICK) for back in (1, 0))
            twists = np.empty((len(names), 3))
            twists[:, :2] = (se2.transform(after, places) - agents[-1]) / _TICK
            # A disc that did not turn with the formation would roll along the object's side.
            twists[:, 2] = (after[2] - before[2]) / _TICK
            running.command_all(names, twists, True)
            running.step(steps)
            poses = running.poses()
            here = item.mass_pose(poses["object"])
            now = np.array([poses[n][:2] for n in names])
            objects.append(here)
            agents.append(now)
            forces.append(_felt(running, names))
            astray = max(astray, float(np.hypot(*(here - after)[:2])))
            if tick * _TICK > 0.5:
                widest = max(widest, float(_gaps(item, here, now, radius).max()))
    finally:
        running.close()
    way, felt = np.array(objects), np.array(forces)
    off = se2.between(trajectory.pose[-1], way[-1])
    moved = float(np.hypot(*np.diff(way[:, :2], axis=0).T).sum()) > 0.05
    return FormationPush(
        _slid(way, np.array(agents), trajectory.length),
        energy(way, contacts.points, felt) if moved else float("nan"),
        widest <= _KEPT and astray <= _TRANSPORTED,
        widest,
        astray,
        float(np.hypot(*off[:2])),
        abs(float(off[2])),
        way,
        np.array(agents),
        felt,
    )


def _slid(objects: Array, agents: Array, length: float) -> float:
    """(3.2) over the length of the trajectory that was asked for."""
    travelled = float(np.hypot(*np.diff(objects[:, :2], axis=0).T).sum())
    return displacement(objects, agents) * travelled / length if travelled > 0.0 else float("inf")


def _felt(world: World, names: list[str]) -> Array:
    """``(n, 2)`` [N] on the object, of each disc."""
    forces = np.zeros((len(names), 2))
    for contact in world.read_contacts():
        pair = (contact.body_a, contact.body_b)
        if "object" in pair:
            other, sign = (pair[1], 1.0) if pair[0] == "object" else (pair[0], -1.0)
            if other in names:
                forces[names.index(other)] = sign * contact.force[:2]
    return forces


def _gaps(item: ObjectSpec, pose: Array, agents: Array, radius: float) -> Array:
    """``(n,)`` [m] between discs and object, 0 where they overlap."""
    outline = item.geometry.outline
    local = se2.transform(se2.inverse(pose), agents)
    away = distance(outline, local)
    away[inside(outline, local)] *= -1.0
    return np.maximum(0.0, away - radius)
