"""Maps in the map_server format, good ones and bad (FAULTS 20, 27)."""

import tracemalloc

import numpy as np
import pytest
import yaml
from PIL import Image

from push_model import SettingsError
from push_model.occupancy import rasterise
from push_scenario.files import read_yaml
from push_scenario.map_file import load_map
from push_scenario.scenario import scenario_from_mapping

FREE, GREY, WALL = 254, 205, 0


def write(folder, pixels, suffix="pgm", **keys):
    """A map; the path of its YAML file."""
    Image.fromarray(np.asarray(pixels, dtype=np.uint8)).save(folder / f"room.{suffix}")
    return write_yaml(folder, **{"image": f"room.{suffix}", **keys})


def write_yaml(folder, **keys):
    values = {"resolution": 0.05, "origin": [-1.0, -0.5, 0.0]}
    (folder / "room.yaml").write_text(yaml.safe_dump({**values, **keys}))
    return folder / "room.yaml"


def read(path):
    return load_map(read_yaml(path), str(path), path.parent)


def scenario_in(path):
    robots = {"r": {"type": "epuck", "start": [0, 0, 0]}}
    values = {"environment": path.name, "robots": robots}
    return scenario_from_mapping(values, "room", "scenario.yaml", path.parent)


def room():
    pixels = np.full((20, 40), FREE)
    pixels[:3, :] = WALL  # at the top: the greatest y
    pixels[10, 30] = GREY
    return pixels


@pytest.mark.parametrize("suffix", ["pgm", "png"])
def test_cells_lie_where_map_server_puts_them(tmp_path, suffix):
    grid = scenario_in(write(tmp_path, room(), suffix)).grid

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
        return read(write(tmp_path, pixels, **keys)).grid.occupied[2, 1:-1].tolist()

    assert inner() == [False, True, False, True, False]
    assert inner(free_thresh=0.5) == [False, False, False, True, False]
    assert inner(mode="scale", free_thresh=0.2) == [False, False, False, True, False]
    assert (
        read(write(tmp_path, 255 - pixels, negate=True)).grid.occupied.tolist()
        == read(write(tmp_path, pixels)).grid.occupied.tolist()
    )
    percent = np.zeros((5, 7))
    percent[2, 2], percent[2, 3], percent[2, 4] = 49, 60, 255
    raw = read(write(tmp_path, percent, mode="raw")).grid.occupied[2, 1:-1].tolist()
    assert raw == [False, False, True, True, False]


def test_transparent_pixels_are_unknown(tmp_path):
    pixels = np.full((5, 5, 4), 255)
    pixels[2, 2, 3] = 0
    grid = read(write(tmp_path, pixels, "png")).grid
    assert grid.occupied[2, 2] and not grid.occupied[2, 1]


def test_a_map_can_be_carried_inside_a_scenario(tmp_path):
    scenario = scenario_in(write(tmp_path, room()))
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
    grid = rasterise(read(write(tmp_path, pixels)))
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
        read(path)
    for word in words:
        assert word in str(error.value), str(error.value)


def test_broken_and_tiny_images_are_refused(tmp_path):
    path = write(tmp_path, room())
    whole = (tmp_path / "room.pgm").read_bytes()
    (tmp_path / "room.pgm").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(SettingsError, match="no readable image"):
        read(path)
    Image.fromarray(np.full((9, 9), 20000, dtype=np.uint16)).save(tmp_path / "room.png")
    with pytest.raises(SettingsError, match="8 bits"):
        read(write_yaml(tmp_path, image="room.png"))
    with pytest.raises(SettingsError, match="no free cell"):
        read(write(tmp_path, np.full((9, 9), WALL)))
    with pytest.raises(SettingsError, match="fewer than 3 x 3"):
        read(write(tmp_path, np.full((2, 2), FREE)))


@pytest.mark.parametrize("free_thresh", [0.1, 0.196, 0.25, 0.6])
@pytest.mark.parametrize("suffix", ["pgm", "png"])
def test_unknown_is_wall_whatever_the_thresholds_say(tmp_path, free_thresh, suffix):
    """Map savers write 205 for unknown, some beside a free_thresh that would make it free."""
    random = np.random.default_rng(7)
    pixels = random.choice([FREE, GREY, WALL], (30, 40), p=[0.6, 0.3, 0.1])
    if suffix == "png":
        pixels = np.dstack([pixels] * 3)  # saved as colours
    grid = read(write(tmp_path, pixels, suffix, free_thresh=free_thresh)).grid
    expected = pixels.reshape(30, 40, -1)[::-1, :, 0] != FREE
    assert np.array_equal(grid.occupied[1:-1, 1:-1], expected[1:-1, 1:-1])


def test_a_map_as_large_as_allowed_takes_little_memory(tmp_path):
    """100 m x 100 m in cells of 5 cm: less than ten bytes a cell at the worst moment."""
    pixels = np.full((2000, 2000), FREE, dtype=np.uint8)
    path = write(tmp_path, pixels)
    tracemalloc.start()
    grid = read(path).grid
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert grid.occupied.shape == (2000, 2000) and grid.occupied.sum() == 4 * 1999
    assert peak < 10 * 2000 * 2000


def test_a_larger_map_is_refused_before_it_is_decoded(tmp_path):
    """A file of a few hundred bytes may claim any size."""
    (tmp_path / "room.pgm").write_bytes(b"P5 60000 50000 255\n" + bytes(500))
    tracemalloc.start()
    with pytest.raises(SettingsError, match=r"60000 x 50000 cells|no readable image"):
        read(write_yaml(tmp_path, image="room.pgm"))
    assert tracemalloc.get_traced_memory()[1] < 1e7
    tracemalloc.stop()
    with pytest.raises(SettingsError, match=r"2001 x 2000 cells, over 4000000"):
        read(write(tmp_path, np.full((2000, 2001), FREE)))
