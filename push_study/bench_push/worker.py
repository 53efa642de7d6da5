"""A room of benchnpin for another process: a line of JSON in, a line of JSON out.

Runs with the Python of another environment, without this project. The physics of the room is not
changed. Its observations as images and the rewards of box delivery are left out, for they would
take most of the time, and its actions are velocities. Asked for ``reset``, it tells the room and
where everything is; asked for ``step``, where everything is then, and the measures of benchnpin
once the episode is over.
"""

import json
import math
import os
import random
import sys
import warnings
from typing import Any

ACTION = 0.2
"""[s] of an action, but of one in which a robot touches a wall in box delivery: it ends then."""
LIMIT = 2000
"""Actions from one box that is cleared or delivered to the next at most, as in the evaluation of
the policy GTSP in IvanIZ/BenchPush (e9f865b)."""


def main() -> None:
    """Serve standard input until it ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # benchnpin prints
    os.environ.update(MPLBACKEND="Agg", SDL_VIDEODRIVER="dummy")
    warnings.simplefilter("ignore")
    from benchnpin.common.metrics.task_driven_metric import TaskDrivenMetric

    task: Any = None
    metric: Any = None
    for line in sys.stdin:
        ask = json.loads(line)
        if "reset" in ask:
            task = TASKS[ask["task"]](ask["room"], ask["reset"])
            info = task.reset()
            metric = TaskDrivenMetric("", task.env.cfg.agent.mass)
            metric.reset(info)
            tell = task.room(info)
        else:
            reward, over, info = task.step(*ask["step"])
            metric.update(info=info, reward=reward, eps_complete=over)
            tell = {"done": task.done(info), "over": over}
            if over:
                tell["share"] = metric.success_rates[-1]
                tell["efficiency"] = (
                    metric.efficiency_scores[-1] if metric.total_robot_dist else 0.0
                )
                tell["effort"] = metric.effort_scores[-1]
                tell["path_m"] = metric.total_robot_dist
                tell["time_s"] = task.time
        tell["pose"] = info["state"]
        tell |= task.boxes(info)
        answers.write(json.dumps(tell, default=_plain) + "\n")
        answers.flush()


class Clearing:
    """Boxes that are to be pushed out of an area. It also tells the pushes among which the policy
    GTSP chooses."""

    def __init__(self, name: str, seed: int) -> None:
        from benchnpin.environments.area_clearing.area_clearing import AreaClearingEnv

        random.seed(seed)
        agent, sim = {"action_type": "velocity"}, {"t_max": LIMIT}
        room = {"env": name, "low_dim_state": True, "render": {"show": False}}
        self.env = AreaClearingEnv({**room, "agent": agent, "sim": sim})
        self.time = 0.0

    def reset(self) -> dict[str, Any]:
        """What the room tells."""
        return dict(self.env.reset()[1])

    def step(self, speed: float, turn: float) -> tuple[float, bool, dict[str, Any]]:
        """An action, of the greatest speed and turn rate: reward, whether it was the last one, and
        what the room tells."""
        _, reward, terminated, truncated, info = self.env.step((speed, turn))
        self.time += ACTION
        return reward, terminated or truncated, info

    def done(self, info: dict[str, Any]) -> int:
        """Boxes that are out."""
        return int(info["box_count"])

    def boxes(self, info: dict[str, Any]) -> dict[str, Any]:
        """Outlines, and a list of pushes of each box."""
        from shapely import Polygon

        area = Polygon(self.env.boundary_vertices)
        pushes = [_pushes(box, self.env.boundary_goals, area) for box in info["obs"]]
        return {"boxes": info["obs"], "pushes": pushes}

    def room(self, info: dict[str, Any]) -> dict[str, Any]:
        """What does not change in an episode. Walls and columns are as large as in the physics,
        which rounds their corners by a radius."""
        from benchnpin.common.geometry.polygon import create_polygon_from_line

        env = self.env
        fixed = [*map(create_polygon_from_line, env.walls), *env.static_obstacles]
        inner, outer = env.wall_shapes[: len(env.walls)], env.wall_shapes[len(env.walls) :]
        shapes = (*inner, *env.static_obs_shapes)
        rim = max(shape.radius for shape in outer)
        return {
            "area": env.boundary_vertices,
            "limits": [max(abs(v[k]) for v in env.outer_boundary_vertices) - rim for k in range(2)],
            "edges": [list(line.coords) for line in env.boundary_goals],
            "fixed": [_grown(o, s.radius) for o, s in zip(fixed, shapes, strict=True)],
            "speed": env.target_speed,
            "turn": env.max_yaw_rate_step,
        }


class Delivery:
    """Boxes that are to be pushed into a receptacle."""

    def __init__(self, name: str, seed: int) -> None:
        from benchnpin.environments.box_delivery.box_delivery_env import BoxDeliveryEnv

        misc = {"random_seed": seed, "inactivity_cutoff": LIMIT}
        room = {"agent": {"action_type": "velocity"}, "render": {"show": False}, "misc": misc}
        self.env = BoxDeliveryEnv({**room, "env": {"obstacle_config": name}})
        self.env.generate_observation = lambda done=False: None
        self.env.shortest_path_distance = lambda *_: 0.0  # only rewards use it

        self.time, self._work = 0.0, 0.0
        self._all: list[Any] = []
        self._middles: list[Any] = []

    def reset(self) -> dict[str, Any]:
        """What the room tells. From now on, its time is counted."""
        _, info = self.env.reset()
        self._all = sorted(self.env.boxes, key=lambda box: box.idx)
        self._middles = [box.body.position for box in self._all]
        step = self.env.space.step

        def counted(time: float) -> None:
            self.time += time
            step(time)

        self.env.space.step = counted
        return dict(info)

    def step(self, speed: float, turn: float) -> tuple[float, bool, dict[str, Any]]:
        """As above. The room bounds the speed; of the turn rate, its action space says 1 rad/s.

        Its measure of work compares each box with its successor in the list once one is delivered;
        here it is the sum of area times way of each box.
        """
        action = speed * self.env.target_speed, turn
        _, reward, terminated, truncated, info = self.env.step(action)
        middles = [box.body.position for box in self._all]
        ways = [a.get_distance(b) for a, b in zip(self._middles, middles, strict=True)]
        self._middles, self._work = middles, self._work + self.env.cfg.boxes.box_size**2 * sum(ways)
        return reward, terminated or truncated, {**info, "total_work": self._work}

    def done(self, info: dict[str, Any]) -> int:
        """Boxes that are delivered."""
        return int(info["cumulative_cubes"])

    def boxes(self, info: dict[str, Any]) -> dict[str, Any]:
        """Outlines; none of a box that is delivered."""
        found: list[Any] = [None] * len(info["box_completed_statuses"])
        for box in self.env.boxes:
            found[box.idx] = [list(box.body.local_to_world(v)) for v in box.get_vertices()]
        return {"boxes": found}

    def room(self, info: dict[str, Any]) -> dict[str, Any]:
        """What does not change in an episode. What is fixed is as large as in the physics."""
        env, fixed = self.env, []
        for shape in env.boundaries:
            if shape.label not in ("wall", "receptacle"):
                outline = [list(shape.body.local_to_world(v)) for v in shape.get_vertices()]
                fixed.append(_grown(outline, shape.radius))
        (x, y), half = env.receptacle_position, 0.5 * env.receptacle_size
        corners = ((-half, -half), (half, -half), (half, half), (-half, half))
        return {
            "limits": [0.5 * env.room_length, 0.5 * env.room_width],
            "fixed": fixed,
            "receptacle": [[x + a, y + b] for a, b in corners],
            "robot": _hull(env.robot.body.shapes),
            "box": env.cfg.boxes.box_size,
            "grown": env.boxes[0].radius,
            "speed": env.target_speed,
            "turn": 1.0,
        }


def _grown(outline: Any, radius: float) -> list[Any]:
    """By a radius, with sharp corners."""
    from shapely import Polygon

    return list(Polygon(outline).buffer(radius, join_style=2).exterior.coords)[:-1]


def _hull(shapes: Any) -> list[Any]:
    """Outline about the shapes of a body, in its frame."""
    from shapely import Polygon, union_all

    parts = [Polygon(s.get_vertices()).buffer(s.radius, join_style=2) for s in shapes]
    return list(union_all(parts).convex_hull.exterior.coords)[:-1]


def _pushes(box: Any, lines: Any, area: Any) -> list[list[list[float]]]:
    """``(k, 3, 2)``, a push over each line, as the policy GTSP of Bench-Push plans it: from 2 m
    behind a point near the middle of a box, through that point, to the nearest one of the line.

    GTSP plans only at the start, when all boxes lie well within the area. Of a box that is half out
    the point may be beyond the line: the push then goes straight out, by half a metre and a bit.
    """
    from shapely import Point, Polygon, shortest_line

    middle, found = Polygon(box).buffer(-0.4), []
    for line in lines:
        (x, y), (u, v) = shortest_line(middle, line).coords
        length = ((x - u) ** 2 + (y - v) ** 2) ** 0.5
        if length < 0.1 or not area.contains(Point(x, y)):
            (ax, ay), (bx, by) = line.coords
            out = (by - ay) / line.length, (ax - bx) / line.length
            aside = (ax - area.centroid.x) * out[0] + (ay - area.centroid.y) * out[1]
            length = 0.6
            u, v = (c + math.copysign(length, aside) * d for c, d in ((x, out[0]), (y, out[1])))
        begin = [x + 2.0 * (x - u) / length, y + 2.0 * (y - v) / length]
        found.append([begin, [x, y], [u, v]])
    return found


def _plain(value: Any) -> Any:
    """Arrays and numbers of numpy."""
    return value.tolist()


TASKS = {"clearing": Clearing, "delivery": Delivery}

if __name__ == "__main__":
    main()
