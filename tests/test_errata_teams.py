"""Chapters 3 and 4: each entry of docs/errata.md, as printed and as implemented, against an
independent truth. A test fails when the printed formula is put back.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.group_control import GroupController, GroupControlSettings
from grasp_opt.indices import composed_quality
from grasp_opt.object_trajectory import ObjectTrajectory, polynomial
from grasp_opt.placement import PlacementSettings, Placer
from grasp_opt.selection import apart
from grasp_opt.wrench_cone import margin, task_wrenches, wrench_rays
from push_model.limit_surface import PressureLimitSurface
from push_model.screws import point_velocities
from push_model.shape_specs import PolygonShape
from push_model.shapes import rectangle
from push_scenario.bodies import load_object
from swarm_push.density import gaussian, tangential
from swarm_push.law import Scene
from swarm_push.potential import swarm_input
from swarm_push.thesis_law import ThesisLaw, ThesisLawSettings

ELLIPSE = load_object("plate_ellipse")
RING = 0.05
STRAIGHT = polynomial((0.0,), 0.8, 0.1, 0.1)
ROOM = np.array([[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]])


def unit(angle):
    return np.array([math.cos(angle), math.sin(angle)])


def test_3_5_takes_the_nearest_neighbour():
    """Truth: the thesis's own demand that an even spread is best, by brute force on a disc. With
    the greatest angle, or the product over all others, it is not, or its index is not 1."""
    random = np.random.default_rng(1)
    for n in (3, 4, 5):
        even = 2.0 * math.pi * np.arange(n) / n
        angles = np.vstack([even, random.uniform(0.0, 2.0 * math.pi, (4000, n))])
        points = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        found = composed_quality(points, -points)
        assert found[0] == pytest.approx(1.0) and found[1:].min() > 1.0
        apart_by = np.arccos(np.clip(np.einsum("gix,gjx->gij", points, points), -1.0, 1.0))
        others = apart_by[:, ~np.eye(n, dtype=bool)].reshape(-1, n, n - 1)
        for reading in (others.max(axis=2), others.prod(axis=2)):
            index = (2.0 * math.pi / n) ** n / reading.prod(axis=1)
            assert abs(index[0] - 1.0) > 0.5 or index[1:].min() < 0.9 * index[0]


def test_3_8_does_not_depend_on_the_unit_of_length():
    """Truth: the same grasp, measured in metres and in decimetres, is as good."""
    factor, random = 10.0, np.random.default_rng(2)
    outline = np.array(ELLIPSE.geometry.outline)
    small = replace(ELLIPSE, shape=PolygonShape(tuple(map(tuple, outline))))
    large = replace(ELLIPSE, shape=PolygonShape(tuple(map(tuple, factor * outline))))
    stretch = np.array([factor, factor, 1.0])
    task = polynomial((0.6,), 0.8, 0.1, 0.1)
    stretched = ObjectTrajectory(task.time, task.pose * stretch, task.twist * stretch)
    ours, printed = [], []
    for item, trajectory, scale in ((small, task, 1.0), (large, stretched, factor)):
        placer = Placer(item, trajectory, 3, RING * scale)
        surface = item.limit_surface()
        random = np.random.default_rng(2)
        for _ in range(40):
            way = random.uniform(0.0, 1.0, 3) * placer.outline.length
            contacts = placer.outline.at(way)
            ours.append(placer.margin(contacts))
            rays = wrench_rays(contacts.points, contacts.normals, item.contact_friction, 1.0)
            printed.append(margin(rays, task_wrenches(trajectory.body_twists, surface, 1.0)))
    assert ours[:40] == pytest.approx(ours[40:], abs=1e-6)
    assert np.abs(np.subtract(printed[:40], printed[40:])).max() > 0.1


def test_3_13_and_3_17_forces_add_up_to_the_floors_whatever_the_step():
    """Truth: the friction of the floor, mu m g, in a straight push. The printed forces halve when
    there are twice as many steps, and do not know the mass."""
    total = {}
    for steps in (10, 20):
        for model in ("limit_surface", "printed"):
            settings = PlacementSettings(steps=steps, model=model)
            placer = Placer(ELLIPSE, STRAIGHT, 2, RING, settings)
            way = placer.outline.way_of_angle(np.array([math.pi - 0.3, math.pi + 0.3]))
            forces = placer.placement(way).forces[3:-3].sum(axis=1)
            total[steps, model] = float(np.hypot(*forces.T).mean())
    assert PlacementSettings().model == "limit_surface"
    floor = 0.6 * 0.3 * 9.81
    for steps in (10, 20):
        assert total[steps, "limit_surface"] == pytest.approx(floor, rel=0.03)
    assert total[10, "printed"] / total[20, "printed"] == pytest.approx(2.0, rel=0.1)


def test_3_18_no_bound_on_polar_angles_keeps_discs_apart():
    """Truth: distances between centres. Of two pairs on a long plate, the one with the greater
    angle overlaps and the other does not."""
    plate, pairs = ContactOutline(rectangle(0.6, 0.12)), []
    for points in ([[0.3, -0.04], [0.3, 0.04]], [[0.17, 0.06], [0.28, 0.06]]):
        angles = np.arctan2(*np.transpose(points)[::-1])
        contacts = plate.at(plate.way_of_angle(angles))
        assert contacts.points == pytest.approx(np.array(points), abs=1e-9)
        distance = np.hypot(*np.diff(contacts.centres(RING), axis=0)[0])
        assert apart(contacts, RING, 0.0) == (distance >= 2.0 * RING)
        pairs.append((float(np.ptp(angles)), apart(contacts, RING, 0.0)))
    assert pairs[0][0] > pairs[1][0] and (pairs[0][1], pairs[1][1]) == (False, True)


def plate_group(angles, **settings):
    outline = ContactOutline(ELLIPSE.geometry)
    ways = outline.way_of_angle(np.array(angles))
    return GroupController(
        outline, ways, 0.2, ELLIPSE.limit_surface(), RING, GroupControlSettings(**settings)
    )


def test_3_21_the_feed_forward_is_the_floors_friction_at_the_desired_velocity():
    """Truth: Coulomb friction summed over the plate. sqrt(J/m), the root mean square of a radius,
    is above its mean; at v_o an object at rest has no feed-forward; and 0/0 is zero."""
    group, rest = plate_group((math.pi - 0.4, math.pi + 0.4)), np.zeros(3)
    floor = PressureLimitSurface.uniform(ELLIPSE.geometry, 0.6 * 0.3 * 9.81, points=20000)
    for twist in (np.array([0.05, 0.0, 0.0]), np.array([0.0, 0.0, 0.3])):
        command = group.command(rest, twist, rest, twist, group.places)
        assert command.wrench == pytest.approx(floor.wrench(twist), rel=0.01, abs=1e-3)
    spin = floor.wrench(np.array([0.0, 0.0, 0.3]))[2]
    gamma = math.sqrt(ELLIPSE.geometry.inertia_per_mass)
    assert 0.6 * 0.3 * 9.81 * gamma > 1.05 * spin  # as printed
    settings = {"velocity_gain": 0.0, "turning_gain": 0.0}
    starting = plate_group((math.pi - 0.4, math.pi + 0.4), **settings)
    wanted = np.array([0.05, 0.0, 0.0])
    command = starting.command(rest, rest, rest, wanted, starting.places)
    assert command.wrench == pytest.approx(floor.wrench(wanted), rel=0.01, abs=1e-3)
    assert not starting.command(rest, rest, rest, rest, starting.places).wrench.any()


def test_3_2_3_the_plate_has_the_semi_axes_of_its_inertia():
    """Truth: sums over a grid of points. Axes of 0.5 m and 0.2 m make 0.0054 kg m^2."""
    points = np.stack(np.meshgrid(*[np.linspace(-0.3, 0.3, 1201)] * 2), axis=-1).reshape(-1, 2)
    inertia = []
    for a, b in ((0.255, 0.175), (0.25, 0.1)):
        inside = points[((points / [a, b]) ** 2).sum(axis=1) < 1.0]
        inertia.append(0.3 * (inside**2).sum(axis=1).mean())
    assert inertia[0] == pytest.approx(0.0072, rel=0.01) and inertia[1] < 0.0055
    assert ELLIPSE.mass * ELLIPSE.geometry.inertia_per_mass == pytest.approx(inertia[0], rel=0.01)


def test_3_25_velocities_along_forces_are_not_those_of_the_task():
    """Truth: rigid-body motion. The twist that the contacts' normal velocities make, by least
    squares, is the task's with our law; along their forces the robots make another one."""
    angles = math.pi + np.array([-1.3, -0.5, 0.4, 1.2])
    task = np.array([0.05, 0.0, 0.12])
    off = {}
    assert GroupControlSettings().law == "twist"
    for law in ("twist", "printed"):
        group = plate_group(angles, law=law)
        command = group.command(np.zeros(3), task, np.zeros(3), task, group.places)
        contacts = command.contacts
        rows = [point_velocities(e, contacts.points) for e in np.eye(3)]
        A = np.column_stack([(r * contacts.normals).sum(axis=1) for r in rows])
        speeds = (command.velocities * contacts.normals).sum(axis=1)
        scale = np.array([1.0, 1.0, 0.15])
        made = np.linalg.lstsq(A / scale, speeds, rcond=None)[0]
        wanted = task * scale
        cosine = made @ wanted / np.linalg.norm(made) / np.linalg.norm(wanted)
        off[law] = math.degrees(math.acos(min(1.0, cosine)))
    assert off["twist"] < 6.0 < 3.0 * off["twist"] + 6.0 < off["printed"], off


def spread(density, centre, size=1.2):
    """Covariance ``(2, 2)`` [m^2] of a density, by summing it over a grid."""
    points = np.stack(np.meshgrid(*[np.linspace(-size, size, 401)] * 2), axis=-1).reshape(-1, 2)
    values = density.at(points + centre)
    return np.einsum("n,ni,nj->ij", values, points, points) / values.sum()


def printed_form(sigma_x, sigma_y, angle, wrong=2.0):
    """B of (4.3), with ``wrong`` in the place of the second 4."""
    c, s, double = math.cos(angle), math.sin(angle), math.sin(2.0 * angle)
    aside = double / (4.0 * sigma_x**2) - double / (wrong * sigma_y**2)
    x, y = 0.5 / sigma_x**2, 0.5 / sigma_y**2
    return np.array([[c**2 * x + s**2 * y, aside], [aside, s**2 * x + c**2 * y]])


def test_4_2_the_density_falls_off_from_its_mean():
    """Truth: robots are to gather at the mean, so that it has the greatest density of all."""
    random = np.random.default_rng(3)
    for _ in range(50):
        mean = random.normal(size=2)
        density = gaussian(mean, *random.uniform(0.03, 0.2, 2), random.uniform(-3, 3))
        points = mean + random.normal(size=(200, 2))
        at_mean = density.at(mean[None])[0]
        assert (density.at(points) < at_mean).all()
        d = points - mean
        B = 0.5 * density.roots[0].T @ density.roots[0]
        assert (np.einsum("ni,ij,nj->n", d, B, d) > 0.0).all()  # exp(+d'Bd) grows everywhere
        assert (density.at(points) / at_mean) == pytest.approx(
            np.exp(-np.einsum("ni,ij,nj->n", d, B, d))
        )


def test_4_3_both_denominators_are_4():
    """Truth: the covariance, summed over a grid. As printed a round density has a direction, and B
    is not positive definite for many others."""
    random, bad = np.random.default_rng(4), 0
    for _ in range(10):
        x, y, angle = random.uniform(0.08, 0.2), random.uniform(0.05, 0.2), random.uniform(-3, 3)
        R = np.column_stack([unit(angle), unit(angle + 0.5 * math.pi)])
        found = spread(gaussian(np.zeros(2), x, y, angle), np.zeros(2))
        assert found == pytest.approx(R @ np.diag([x**2, y**2]) @ R.T, abs=1e-4)
        assert np.linalg.inv(2.0 * printed_form(x, y, angle, 4.0)) == pytest.approx(found, abs=1e-4)
        bad += bool(np.linalg.eigvalsh(printed_form(x, 0.5 * x, angle)).min() <= 0.0)
    assert bad >= 3
    assert abs(printed_form(0.1, 0.1, 0.7)[0, 1]) > 10.0


def test_4_4_the_wide_axis_is_tangential_from_every_side():
    """Truth: the covariance, summed over a grid. atan(dx/dy) puts it along the way to the object
    where that is diagonal, and is not defined where dy = 0."""
    for phi in np.linspace(-math.pi, math.pi, 17):
        item = 0.5 * unit(phi)
        found = spread(tangential(np.zeros(2), item, 0.15, 0.06), np.zeros(2))
        assert abs(np.linalg.eigh(found)[1][:, 1] @ unit(phi)) < 1e-3
    diagonal = math.atan(1.0)
    printed = np.linalg.inv(2.0 * printed_form(0.15, 0.06, diagonal, 4.0))
    assert abs(np.linalg.eigh(printed)[1][:, 1] @ unit(math.pi / 4.0)) > 0.99
    assert np.isfinite(tangential(np.zeros(2), np.zeros(2), 0.1, 0.05).roots).all()


def test_4_4_behind_the_object_the_field_leads_ahead_in_every_direction():
    """Truth: what the zone is for. With atan(vy/vx) the wires change places where vx < 0."""
    for alpha in np.linspace(-math.pi, math.pi, 25)[:-1]:
        v = unit(alpha)
        ahead = swarm_input(-0.3 * v[None], np.zeros(2), v, 0.25)[0] @ v
        assert ahead > 0.9
        if v[0] < -1e-9:
            folded = unit(math.atan(v[1] / v[0]))  # what R(alpha) is made of, as printed
            across = np.array([-folded[1], folded[0]])
            r_in, r_out = -0.3 * v + 0.175 * across, -0.3 * v - 0.175 * across
            field = np.array([r_in[1], -r_in[0]]) / np.linalg.norm(r_in) ** 3
            field += np.array([-r_out[1], r_out[0]]) / np.linalg.norm(r_out) ** 3
            assert field @ v < 0.0


def test_4_4_the_lead_does_not_depend_on_the_rate_of_control():
    """Truth: a swarm's speed is not to change when it is asked twice as often. With dt the length
    of a tick, it does."""
    start = np.array([[-1.2, 0.1], [-1.3, -0.1], [-1.4, 0.1], [-1.2, -0.2], [-1.5, 0.0]])
    moved = {}
    for name in ("lead", "dt"):
        for rate in (25.0, 50.0):
            lead = {"lead": ThesisLawSettings().lead, "dt": 1.0 / rate}[name]
            law = ThesisLaw(ROOM, load_object("swarm_square"), ThesisLawSettings(lead=lead))
            robots = start.copy()
            for k in range(int(2.0 * rate)):
                scene = Scene(
                    k / rate, np.zeros(3), robots, np.array([1.0, 0.0, 0.0]), np.zeros((0, 3))
                )
                robots = robots + law.step(scene).velocities / rate
            moved[name, rate] = float((robots - start).mean(axis=0)[0])
    assert moved["lead", 50.0] == pytest.approx(moved["lead", 25.0], rel=0.1)
    assert moved["dt", 25.0] > 1.5 * moved["dt", 50.0]


def test_4_8_a_swarm_in_front_of_the_object_goes_round_it():
    """Truth: the path of a mean that starts exactly in front. As printed it stays on the line."""
    v, printed = np.array([1.0, 0.0]), np.array([0.4, 0.0])
    mean = printed.copy()
    for _ in range(2000):
        mean = mean + 2e-3 * swarm_input(mean[None], np.zeros(2), v, 0.25)[0]
        d, v3 = np.append(printed, 0.0), np.append(v, 0.0)
        around = np.cross(np.cross(v3, d), d)[:2]
        assert not around.any()  # nothing to divide by its own length
        away = float(np.hypot(*printed))
        push = (away < 0.35) * 1.0 - (away >= 0.45) * 1.0
        printed = printed + 2e-3 * push * printed / away
    assert mean[0] < 0.0 and abs(printed[1]) < 1e-12 < printed[0]
