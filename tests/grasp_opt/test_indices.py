"""(3.5)-(3.8) against closed forms, and against the definitions written out."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.indices import composed_quality, dexterity, extension, modified_hausdorff
from grasp_opt.metrics import displacement, energy, path_length
from push_model import se2
from push_model.grasp import grasp_matrix
from push_model.shapes import ellipse, polygon, rectangle


def ring(n, radius=0.2, turn=0.0):
    angle = 2.0 * np.pi * np.arange(n) / n + turn
    points = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return points, -points / radius


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_evenly_round_a_disc(n):
    points, normals = ring(n)
    assert composed_quality(points, normals) == pytest.approx(1.0)
    area = 0.5 * n * 0.04 * math.sin(2.0 * math.pi / n)
    assert extension(points) == pytest.approx(area, abs=1e-12)
    assert extension(points[::-1]) == pytest.approx(area, abs=1e-12)
    # G G' is diag(n, n, n r^2 / c^2)
    assert dexterity(points, 0.1) == pytest.approx(0.5)
    assert dexterity(points, 0.5) == pytest.approx(0.4)


def test_by_the_definitions_on_a_thousand_grasps():
    random = np.random.default_rng(2)
    outline = ContactOutline(ellipse(0.255, 0.175))
    for n in (2, 3, 5):
        contacts = [outline.at(w) for w in random.uniform(0, outline.length, (340, n))]
        points = np.array([c.points for c in contacts])
        normals = np.array([c.normals for c in contacts])
        found = composed_quality(points, normals), extension(points), dexterity(points, 0.13)
        for k, c in enumerate(contacts):
            central = [-p / np.hypot(*p) for p in c.points]
            value = (2 * math.pi / n) ** n
            for i in range(n):
                near = min(
                    math.acos(min(1.0, max(-1.0, central[i] @ central[j])))
                    for j in range(n)
                    if j != i
                )
                value /= abs(near - math.acos(min(1.0, c.normals[i] @ central[i])))
            assert found[0][k] == pytest.approx(value, rel=1e-6)
            G = grasp_matrix(c.points) / np.array([[1.0], [1.0], [0.13]])
            s = np.linalg.svd(G, compute_uv=False)
            assert found[2][k] == pytest.approx(s[-1] / s[0], abs=1e-7)
            hull = polygon(c.points).area if n == 3 else None
            if hull is not None:
                assert found[1][k] == pytest.approx(hull)


def test_hausdorff_by_hand_and_by_definition():
    x, y, z = np.eye(3)
    assert modified_hausdorff(np.array([[x, y]]), np.array([x])) == pytest.approx([1.0])
    assert modified_hausdorff(np.array([[x]]), np.array([x, y])) == pytest.approx([1.0])
    assert modified_hausdorff(np.array([[x, y]]), np.array([z])) == pytest.approx([0.0])
    random = np.random.default_rng(4)
    a, b = random.normal(size=(50, 9, 3)), random.normal(size=(17, 3))
    a /= np.linalg.norm(a, axis=2, keepdims=True)
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    cosine = a @ b.T
    expected = np.maximum(cosine.max(axis=2).mean(axis=1), cosine.max(axis=1).mean(axis=1))
    assert modified_hausdorff(a, b) == pytest.approx(expected)


@pytest.mark.parametrize("shape", [rectangle(0.35, 0.2), ellipse(0.25, 0.1)])
def test_outline_points_angles_and_normals(shape):
    outline = ContactOutline(shape)
    random = np.random.default_rng(1)
    way = random.uniform(0.0, outline.length, 500)
    contacts = outline.at(way)
    theta = np.arctan2(contacts.points[:, 1], contacts.points[:, 0])
    assert outline.way_of_angle(theta) == pytest.approx(way, abs=1e-9)
    assert np.hypot(*contacts.normals.T) == pytest.approx(np.ones(500))
    assert outline.length == pytest.approx(
        path_length(np.vstack([shape.outline, shape.outline[:1]]))
    )
    if shape.kind == "rectangle":
        assert set(map(tuple, np.round(contacts.normals, 9) + 0.0)) == {
            (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)
        }  # fmt: skip
        assert len(outline.corners) == 4
        k = np.argmin(outline.from_corner(way))
        assert np.hypot(*(shape.outline - contacts.points[k]).T).min() == pytest.approx(
            outline.from_corner(way)[k]
        )
    else:
        # The normals are those of the ellipse to a hundredth of a radian, and never jump.
        grad = contacts.points / np.array([0.25**2, 0.1**2])
        cosine = -(grad * contacts.normals).sum(1) / np.hypot(*grad.T)
        assert np.arccos(np.clip(cosine, -1, 1)).max() < 0.012
        fine = outline.at(np.linspace(0.0, outline.length, 20000)).normals
        assert np.hypot(*np.diff(fine, axis=0).T).max() < 3e-3
        assert np.isinf(outline.from_corner(way)).all()


def test_a_fixed_grasp_is_not_displaced_and_a_sliding_one_by_what_it_slides():
    t = np.linspace(0.0, 1.0, 400)
    objects = np.column_stack([0.8 * t, 0.3 * t**2, 1.2 * t])
    local = np.array([[-0.1, 0.05], [-0.1, -0.05]])
    agents = np.array([se2.transform(p, local) for p in objects])
    assert displacement(objects, agents) == pytest.approx(0.0, abs=1e-12)
    way = local + 0.02 * t[:, None, None] * np.array([[0.0, 1.0], [0.0, 0.0]])
    slid = np.array([se2.transform(p, w) for p, w in zip(objects, way, strict=True)])
    length = path_length(objects[:, :2])
    assert displacement(objects, slid) == pytest.approx(0.02 / length, rel=1e-9)


def test_energy_of_a_straight_push_is_the_friction():
    """Two contacts share 1.8 N along the way, and squeeze each other across it for nothing."""
    objects = np.column_stack([np.linspace(0.0, 0.7, 100), np.zeros(100), np.zeros(100)])
    forces = np.tile([[1.0, 0.4], [0.8, -0.4]], (99, 1, 1))
    assert energy(objects, np.array([[-0.1, 0.1], [-0.1, -0.1]]), forces) == pytest.approx(1.8)
    # On a turn the outer contact goes farther: the work is that of the friction wrench.
    turn = np.column_stack([np.zeros(2000), np.zeros(2000), np.linspace(0.0, 1.0, 2000)])
    points = np.array([[0.2, 0.0], [0.0, 0.1]])
    forces = []
    for theta in 0.5 * (turn[1:, 2] + turn[:-1, 2]):
        forces.append([3.0 * np.array([-np.sin(theta), np.cos(theta)]), [0.0, 0.0]])
    assert energy(turn, points, np.array(forces)) == pytest.approx(3.0, rel=1e-6)


def test_the_angle_of_a_way_inverts():
    outline = ContactOutline(ellipse(0.25, 0.1))
    for theta in (0.3, 2.0, 4.0, 6.1):
        way = outline.way_of_angle(np.array([theta]))
        assert outline.angle_of_way(way) == pytest.approx([theta], abs=1e-9)
        best = minimize_scalar(
            lambda w, t=theta: abs(outline.angle_of_way(np.array([w]))[0] - t),
            bounds=(way[0] - 0.05, way[0] + 0.05),
            method="bounded",
            options={"xatol": 1e-9},
        )
        assert best.x == pytest.approx(way[0], abs=1e-6)
