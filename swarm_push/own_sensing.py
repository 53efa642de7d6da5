"""A swarm without shared poses: each robot has only its own sensing (``robot_sensor.py``), and its
own copy of one law (``local_law.py``). No robot is told the outline of the object, or a pose.

The node gets the poses of all bodies, because motion capture stands in for the sensors; what it
tells the host, and when the task is done, comes from them too. The robots' laws get readings alone.
"""

import numpy as np

from push_job.method import Arena, MethodSpec, Unsuited
from push_job.open_room import OpenRoom, OpenRoomMethod, OpenRoomSettings
from push_model.arrays import Array
from swarm_push.local_law import LocalLaw, LocalLawSettings
from swarm_push.region import is_open
from swarm_push.robot_sensor import RobotSensor, RobotSensorSettings
from swarm_push.swarm_method import check_team


class OwnSensing:
    """All robots; see VelocityLaw."""

    def __init__(self, room: OpenRoom, law: LocalLawSettings, sensor: RobotSensorSettings) -> None:
        self._room, self._law = room, law
        outline = room.item.geometry.outline
        self._sensor = RobotSensor(outline, room.size, sensor, room.seed)
        self._robots: list[LocalLaw] = []
        self._last: float | None = None

    def velocities(self, time: float, pose: Array, robots: Array) -> Array:
        """See VelocityLaw."""
        if len(self._robots) != len(robots):
            room = self._room
            self._robots = [
                LocalLaw(room.radius, room.speed, self._law, (room.seed, 9, i))
                for i in range(len(robots))
            ]
        dt, self._last = 0.0 if self._last is None else time - self._last, time
        readings = self._sensor.look(pose, robots, self._room.target)
        told = [r.step(v, dt) for r, v in zip(self._robots, readings, strict=True)]
        own = np.array(told).reshape(-1, 2)
        c, s = np.cos(robots[:, 2]), np.sin(robots[:, 2])
        return np.column_stack([c * own[:, 0] - s * own[:, 1], s * own[:, 0] + c * own[:, 1]])


def _method(arena: Arena) -> OpenRoomMethod:
    if not is_open(arena.grid):
        raise Unsuited(
            "the map has obstacles; robots with own sensing do not find a way around them"
        )
    law = arena.section("law", LocalLawSettings)
    sensor = arena.section("sensor", RobotSensorSettings)
    return OpenRoomMethod("own-sensing", lambda room: OwnSensing(room, law, sensor), arena)


METHOD = MethodSpec(
    "own-sensing",
    _method,
    {"": OpenRoomSettings, "law": LocalLawSettings, "sensor": RobotSensorSettings},
    check_team,
    "own-sensing",
)
