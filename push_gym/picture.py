"""A room from above as an array of pixels."""

from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from push_gym.arena import PushArena
from push_model import se2
from push_model.arrays import Array

_PIXELS = 480  # of the longer side
_FLOOR, _WALL, _OBJECT, _GOAL, _ROBOT = "#f4f4f2", "#4a4a4a", "#d9902f", "#2f8f5b", "#2a62c9"


def picture(arena: PushArena, room: int = 0) -> Any:
    """``(height, width, 3)`` of one room: goal, object, robots with their headings, obstacles."""
    size = np.array(arena.environment.size)
    scale = _PIXELS / size.max()
    width, height = (int(n) for n in np.ceil(size * scale))
    image = Image.new("RGB", (width, height), _FLOOR)
    draw = ImageDraw.Draw(image)

    def pixels(points: Array) -> list[tuple[float, float]]:
        x, y = (np.atleast_2d(points) * [1.0, -1.0] + 0.5 * size * [1.0, 1.0]).T * scale
        return list(zip(x.tolist(), y.tolist(), strict=True))

    e = arena.environment
    for box in e.boxes:
        half = 0.5 * np.array(box.size)
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        draw.polygon(pixels(se2.transform(se2.pose(*box.centre, box.yaw), corners)), fill=_WALL)
    for circle in e.circles:
        ((x, y),), r = pixels(np.array(circle.centre)), circle.radius * scale
        draw.ellipse((x - r, y - r, x + r, y + r), fill=_WALL)
    for p in e.polygons:
        draw.polygon(pixels(np.array(p.vertices)), fill=_WALL)
    poses, outline = arena.world.poses[room], arena.item.outline
    draw.polygon(pixels(se2.transform(arena.goals[room], outline)), outline=_GOAL, width=3)
    draw.polygon(pixels(se2.transform(poses[-1], outline)), fill=_OBJECT)
    for pose in poses[:-1]:
        body = se2.transform(pose, arena.robot.outline)
        draw.polygon(pixels(body), fill=_ROBOT)
        ahead = se2.transform(pose, np.array([[0.0, 0.0], [arena.robot.footprint_radius, 0.0]]))
        draw.line(pixels(ahead), fill="white", width=2)
    draw.rectangle((0, 0, width - 1, height - 1), outline=_WALL, width=2)
    return np.asarray(image)
