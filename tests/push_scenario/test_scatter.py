"""Random places for robots: apart from all, and an end where there is no room."""

import numpy as np
import pytest

from push_model.free_space import FreeSpace
from push_model.occupancy import rasterise
from push_model.outlines import distance, inside
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object
from push_scenario.scatter import around, scattered

SQUARE, RADIUS = load_object("transport_square"), 0.05
ROOM = FreeSpace(rasterise(EnvironmentSpec((2.0, 2.0), resolution=0.02)))


@pytest.mark.parametrize("seed", range(20))
def test_nothing_is_nearer_than_the_gap(seed):
    random = np.random.default_rng(seed)
    for poses in (
        around(random, 15, SQUARE, RADIUS),
        scattered(random, 15, ROOM, SQUARE.outline, RADIUS),
    ):
        places = poses[:, :2]
        assert poses.shape == (15, 3) and not inside(SQUARE.outline, places).any()
        assert distance(SQUARE.outline, places).min() > RADIUS + 0.02 - 1e-9
        apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) + 10.0 * np.eye(15)
        assert apart.min() > 2.0 * RADIUS + 0.02 - 1e-9
    assert np.abs(places).max() < 1.0 - RADIUS - 0.02 + 1e-9


@pytest.mark.long
def test_too_many_robots_are_refused_with_how_many_fit():
    small = FreeSpace(rasterise(EnvironmentSpec((0.7, 0.7), resolution=0.02)))
    with pytest.raises(SettingsError, match=r"there is room for \d+ of 40 robots"):
        scattered(np.random.default_rng(1), 40, small, SQUARE.outline, RADIUS)
    with pytest.raises(SettingsError, match=r"room for \d+ of 200 robots"):
        around(np.random.default_rng(1), 200, SQUARE, 0.5)
