"""A room of benchnpin for another process: a line of JSON in, a line of JSON out.

Runs with the Python of another environment, without this project. The room is not changed; its
observations as images are left out, and its actions are velocities. Asked for ``reset``, it tells
the room and where everything is; asked for ``step``, where everything is then, and the measures of
benchnpin once the episode is over. Each time it tells the pushes among which the policy GTSP
chooses.
"""

import json
import math
import os
import random
import sys
import warnings
from typing import Any

LIMIT = 2000
"""Actions from one cleared box to the next at most, as in the evaluation of the policy GTSP in
IvanIZ/BenchPush (e9f865b)."""


def main() -> None:
    """Serve standard input until it ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # benchnpin prints
    os.environ.update(MPLBACKEND="Agg", SDL_VIDEODRIVER="dummy")
    warnings.simplefilter("ignore")
    from benchnpin.common.metrics.task_driven_metric import TaskDrivenMetric
    from benchnpin.environments.area_clearing.area_clearing import AreaClearingEnv
    from shapely import Polygon

    env: Any = None
    metric: Any = None
    for line in sys.stdin:
        ask = json.loads(line)
        if "reset" in ask:
            random.seed(ask["reset"])
            if env is None:
                agent, sim = {"action_type": "velocity"}, {"t_max": LIMIT}
                room = {"env": ask["room"], "low_dim_state": True, "render": {"show": False}}
                env = AreaClearingEnv({**room, "agent": agent, "sim": sim})
            _, info = env.reset()
            metric = TaskDrivenMetric("", env.cfg.agent.mass)
            metric.reset(info)
            tell = _room(env, info)
        else:
            _, reward, terminated, truncated, info = env.step(ask["step"])
            over = terminated or truncated
            metric.update(info=info, reward=reward, eps_complete=over)
            tell = {"cleared": info["box_count"], "over": over}
            if over:
                tell["share"] = metric.success_rates[-1]
                tell["efficiency"] = metric.efficiency_scores[-1]
                tell["effort"] = metric.effort_scores[-1]
                tell["path_m"] = metric.total_robot_dist
        tell["pose"], tell["boxes"] = info["state"], info["obs"]
        area = Polygon(env.boundary_vertices)
        tell["pushes"] = [_pushes(box, env.boundary_goals, area) for box in info["obs"]]
        answers.write(json.dumps(tell, default=_plain) + "\n")
        answers.flush()


def _room(env: Any, info: dict[str, Any]) -> dict[str, Any]:
    """What does not change in an episode. Walls and columns are as large as in the physics, which
    rounds their corners by a radius."""
    from benchnpin.common.geometry.polygon import create_polygon_from_line
    from shapely import Polygon

    fixed = [*map(create_polygon_from_line, env.walls), *env.static_obstacles]
    inner, outer = env.wall_shapes[: len(env.walls)], env.wall_shapes[len(env.walls) :]
    grown = [
        list(Polygon(outline).buffer(shape.radius, join_style=2).exterior.coords)[:-1]
        for outline, shape in zip(fixed, (*inner, *env.static_obs_shapes), strict=True)
    ]
    rim = max(shape.radius for shape in outer)
    return {
        "area": env.boundary_vertices,
        "limits": [max(abs(v[k]) for v in env.outer_boundary_vertices) - rim for k in range(2)],
        "edges": [list(line.coords) for line in env.boundary_goals],
        "fixed": grown,
        "speed": env.target_speed,
        "turn": env.max_yaw_rate_step,
    }


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


if __name__ == "__main__":
    main()
