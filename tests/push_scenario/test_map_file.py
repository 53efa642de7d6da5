"""Maps in the map_server format, good ones and bad (FAULTS 20)."""

import numpy as np
import pytest
import yaml
from PIL import Image

from push_model import SettingsError
from push_model.occupancy import rasterise
from push_scenario.scenario import load_scenario, scenario_from_mapping

FREE, GREY, WALL = 254, 205, 0


def write(folder, pixels, suffix="pgm", **keys):
    """A map and a scenario in it; the path of the scenario."""
    Image.fromarray(np.asarray(pixels, dtype=np.uint8)).save(folder / f"room.{suffix}")
    return write_yaml(folder, **{"image": f"room.{suffix}", **keys})


def write_yaml(folder, **keys):
    values = {"resolution": 0.05, "origin": [-1.0, -0.5, 0.0]}
    (folder / "room.yaml").write_text(yaml.safe_dump({**values, **keys}))
    scenario = {
        "environment": "room.yaml",
        "robots": {"r": {"type": "epuck", "start": [0, 0, 0]}},
    }
    (folder / "scenario.yaml").write_text(yaml.safe_dump(scenario))
    return str(folder / "scenario.yaml")


def room():
    pixels = np.full((20, 40), FREE)
    pixels[:3, :] = WALL  # at the top: the greatest y
    pixels[10, 30] = GREY
    return pixels


@pytest.mark.parametrize("suffix", ["pgm", "png"])
def test_cells_lie_where_map_server_puts_them(tmp_path, suffix):
    grid = load_scenario(write(tmp_path, room(), suffix)).grid

    def occupied(x, y):
        column, row = np.floor((np.array([x, y]) - grid.origin) / grid.resolution).astype(int)
        return bool(grid.occupied[row, column])

    assert grid.occupied.shape == (20, 40) and grid.extent == pytest.approx((-1, 1, -0.5, 0.5))
    assert occupied(0.0, 0.4) and not occupied(0.0, -0.4)
    assert occupied(0.52, -0.02), "unknown counts as occupied"
    assert occupied(-0.99, 0.0) and occupied(0.0, -0.49), "and so does the edge"


def test_thresholds_modes_and_negation(tmp_path):
    pixels = np.full((5, 7), FREE)
    pixels[2, 2], pixels[2, 4] = 150, 40  # 41 % and 84 % occupied

    def inner(**keys):
        return load_scenario(write(tmp_path, pixels, **keys)).grid.occupied[2, 1:-1].tolist()

    assert inner() == [False, True, False, True, False]
    assert inner(free_thresh=0.5) == [False, False, False, True, False]
    assert inner(mode="scale", free_thresh=0.2) == [False, False, False, True, False]
    assert (
        load_scenario(write(tmp_path, 255 - pixels, negate=True)).grid.occupied.tolist()
        == load_scenario(write(tmp_path, pixels)).grid.occupied.tolist()
    )
    percent = np.zeros((5, 7))
    percent[2, 2], percent[2, 3], percent[2, 4] = 49, 60, 255
    raw = load_scenario(write(tmp_path, percent, mode="raw")).grid.occupied[2, 1:-1].tolist()
    assert raw == [False, False, True, True, False]


def test_transparent_pixels_are_unknown(tmp_path):
    pixels = np.full((5, 5, 4), 255)
    pixels[2, 2, 3] = 0
    grid = load_scenario(write(tmp_path, pixels, "png")).grid
    assert grid.occupied[2, 2] and not grid.occupied[2, 1]


def test_a_map_can_be_carried_inside_a_scenario(tmp_path):
    scenario = load_scenario(write(tmp_path, room()))
    again = scenario_from_mapping(yaml.safe_load(scenario.text), "room", "bag")
    assert np.array_equal(again.grid.occupied, scenario.grid.occupied)
    assert again.grid.extent == pytest.approx(scenario.grid.extent)
    broken = yaml.safe_load(scenario.text)
    broken["environment"]["image"] = "data:image/png;base64,!!"
    with pytest.raises(SettingsError, match="image: no base64"):
        scenario_from_mapping(broken, "room", "bag")


def test_rectangles_cover_the_occupied_cells_once(tmp_path):
    random = np.random.default_rng(3)
    pixels = np.where(random.random((30, 40)) < 0.3, WALL, FREE)
    grid = rasterise(load_scenario(write(tmp_path, pixels)).environment)
    count = np.zeros(grid.occupied.shape, dtype=int)
    for x0, x1, y0, y1 in grid.rectangles():
        c0, c1 = np.round((np.array([x0, x1]) - grid.origin[0]) / grid.resolution).astype(int)
        r0, r1 = np.round((np.array([y0, y1]) - grid.origin[1]) / grid.resolution).astype(int)
        count[r0:r1, c0:c1] += 1
    assert (count == grid.occupied).all()


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"image": "none.pgm"}, ["room.yaml.image", "none.pgm", "does not exist"]),
        ({"image": "room.yaml"}, ["room.yaml.image", "no readable image"]),
        ({"resolution": -1}, ["room.yaml.resolution", "-1", "expected"]),
        ({"resolution": None}, ["room.yaml.resolution", "expected a number"]),
        ({"origin": [0, 0]}, ["room.yaml.origin", "3 values"]),
        ({"origin": [0, 0, 1.0]}, ["rotated"]),
        ({"mode": "blue"}, ["room.yaml.mode", "trinary"]),
        ({"occupied_thresh": 0.1}, ["free_thresh", "occupied_thresh"]),
        ({"colour": 3}, ["unknown key 'colour'", "resolution"]),
    ],
)
def test_wrong_maps_name_file_and_key(tmp_path, keys, words):
    path = write(tmp_path, room(), **keys)
    with pytest.raises(SettingsError) as error:
        load_scenario(path)
    for word in words:
        assert word in str(error.value), str(error.value)


def test_broken_and_tiny_images_are_refused(tmp_path):
    path = write(tmp_path, room())
    whole = (tmp_path / "room.pgm").read_bytes()
    (tmp_path / "room.pgm").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(SettingsError, match="no readable image"):
        load_scenario(path)
    Image.fromarray(np.full((9, 9), 20000, dtype=np.uint16)).save(tmp_path / "room.png")
    with pytest.raises(SettingsError, match="8 bits"):
        load_scenario(write_yaml(tmp_path, image="room.png"))
    with pytest.raises(SettingsError, match="no free cell"):
        load_scenario(write(tmp_path, np.full((9, 9), WALL)))
    with pytest.raises(SettingsError, match="fewer than 3 x 3"):
        load_scenario(write(tmp_path, np.full((2, 2), FREE)))
