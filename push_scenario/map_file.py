"""Maps in the map_server format: a YAML file and a PGM or PNG image beside it. No ROS here.

Unknown cells count as walls. The grey value 205 is always unknown, whatever the thresholds say: map
savers write it for unknown cells, and some of them have written ``free_thresh: 0.25`` beside it.
That is above the occupancy of 0.196 that 205 stands for, and would make unknown cells free.
"""

import base64
import math
from binascii import Error as Base64Error
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from push_model.occupancy import MapSpec, OccupancyGrid
from push_model.settings import SettingsError, bounded, from_mapping, settings

_DATA = "data:image/png;base64,"
_MODES = ("1", "L", "LA", "P", "RGB", "RGBA")  # of 8 bits a channel
_MAX_CELLS = 4_000_000
_UNKNOWN_GREY = 205  # of map savers, in trinary maps


@settings
class MapFile:
    """The keys of map_server, and the walls in simulation."""

    image: str
    resolution: float = bounded(low=1e-3, high=0.5, doc="Size of a cell (m)")
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    negate: int = bounded(
        0, low=0, high=1, doc="1 if white pixels are occupied, 0 if black ones are"
    )
    occupied_thresh: float = bounded(
        0.65,
        low=0.0,
        high=1.0,
        doc="Occupancy, from 0 to 1, above which a cell is occupied (dimensionless)",
    )
    free_thresh: float = bounded(
        0.196,
        low=0.0,
        high=1.0,
        doc="Occupancy, from 0 to 1, below which a cell is free; grey 205 is always unknown "
        "(dimensionless)",
    )
    mode: Literal["trinary", "scale", "raw"] = "trinary"
    wall_height: float = bounded(0.1, low=0.01, high=5.0, doc="Height of the walls (m)")
    wall_friction: float = bounded(
        0.3,
        low=0.0,
        high=2.0,
        doc="Friction coefficient of robot or object and wall (dimensionless)",
    )

    def __post_init__(self) -> None:
        if self.free_thresh > self.occupied_thresh:
            raise SettingsError(
                f"free_thresh {self.free_thresh} is above occupied_thresh {self.occupied_thresh}"
            )
        if not all(math.isfinite(v) for v in self.origin):
            raise SettingsError(f"origin must be finite, got {self.origin}")
        if abs(self.origin[2]) > 1e-6:
            raise SettingsError("a map whose origin is rotated is not supported; rotate the image")


def is_map(values: Any) -> bool:
    """Whether parsed YAML describes a map rather than an arena of obstacles."""
    return isinstance(values, Mapping) and "image" in values


def load_map(values: Any, where: str, folder: Path | None = None) -> MapSpec:
    """The map of parsed YAML.

    Unknown cells and the outermost cells count as occupied, so that nothing leaves a map.
    Transparent pixels are unknown, and so is the grey 205 in trinary maps.

    Parameters
    ----------
    values: the keys of MapFile. where: the file, for errors. folder: that the image's path is
        relative to.

    Raises
    ------
    SettingsError: names file, key and what was expected.
    """
    if isinstance(values, Mapping) and isinstance(values.get("negate"), bool):
        values = {**values, "negate": int(values["negate"])}
    spec = from_mapping(MapFile, values, where)
    source: Path | BytesIO
    if spec.image.startswith(_DATA):
        try:
            source = BytesIO(base64.b64decode(spec.image[len(_DATA) :], validate=True))
        except (Base64Error, ValueError) as error:
            raise SettingsError(f"{where}.image: no base64 data: {error}") from None
    else:
        source = Path(spec.image)
        if not source.is_absolute() and folder is not None:
            source = folder / source
    brightness, transparent = _pixels(source, where)
    occupied = _occupied_levels(spec)[brightness]
    occupied |= transparent
    occupied = occupied[::-1].copy()
    occupied[[0, -1], :] = True
    occupied[:, [0, -1]] = True
    if occupied.all():
        raise SettingsError(f"{where}.image: {source} has no free cell; see negate and free_thresh")
    grid = OccupancyGrid(occupied, spec.resolution, np.array(spec.origin[:2]))
    return MapSpec(grid, spec.wall_height, spec.wall_friction)


def map_to_mapping(spec: MapSpec) -> dict[str, Any]:
    """The map as YAML values that include the image."""
    pixels = np.where(spec.grid.occupied[::-1], 0, 254).astype(np.uint8)
    data = BytesIO()
    Image.fromarray(pixels).save(data, "png")
    return {
        "image": _DATA + base64.b64encode(data.getvalue()).decode(),
        "resolution": spec.grid.resolution,
        "origin": [*spec.grid.origin.tolist(), 0.0],
        "wall_height": spec.wall_height,
        "wall_friction": spec.wall_friction,
    }


def _occupied_levels(spec: MapFile) -> NDArray[np.bool_]:
    """``(766,)`` whether a cell is occupied or unknown, by the sum of its three colours."""
    grey = np.arange(766) / 3.0
    if spec.mode == "raw":
        return grey >= 50  # 0-100 is the occupancy itself, more is unknown
    share = grey / 255.0 if spec.negate else 1.0 - grey / 255.0
    if spec.mode == "scale":
        return share >= 0.5 * (spec.free_thresh + spec.occupied_thresh)
    occupied = share >= spec.free_thresh
    if not spec.negate:
        occupied[3 * _UNKNOWN_GREY] = True
    return occupied


def _pixels(path: Path | BytesIO, where: str) -> tuple[NDArray[np.uint16], NDArray[np.bool_]]:
    """Sum of three colours and transparency, both ``(rows, columns)``, the first row on top."""
    try:
        with Image.open(path) as image:
            if image.width * image.height > _MAX_CELLS:
                raise SettingsError(
                    f"{where}.image: {path} has {image.width} x {image.height} cells, over "
                    f"{_MAX_CELLS}; crop or scale it"
                )
            if min(image.width, image.height) < 3:
                raise SettingsError(f"{where}.image: {path} has fewer than 3 x 3 cells")
            if image.mode not in _MODES:
                raise SettingsError(
                    f"{where}.image: {path} has pixels of kind {image.mode}; save it with 8 bits"
                )
            if image.mode == "L":  # as map savers write: no need for four times the memory
                grey = np.asarray(image, dtype=np.uint16)
                return 3 * grey, np.zeros(grey.shape, dtype=bool)
            colour = np.asarray(image.convert("RGBA"))
    except FileNotFoundError:
        raise SettingsError(f"{where}.image: {path} does not exist") from None
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise SettingsError(f"{where}.image: {path} is no readable image: {error}") from None
    return colour[:, :, :3].sum(axis=2, dtype=np.uint16), colour[:, :, 3] < 128
