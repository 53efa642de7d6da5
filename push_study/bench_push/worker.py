"""A room of benchnpin for another process: a line of JSON in, a line of JSON out.

Runs with the Python of another environment, without this project. The room is not changed; its
observations as images are left out, and its actions are velocities. Asked for ``reset``, it tells
the room and where everything is; asked for ``step``, where everything is then, and the measures of
benchnpin once the episode is over.
"""

import json
import os
import random
import sys
import warnings
from typing import Any

LIMIT = 2000
"""Actions from one cleared box to the next at most, as for the planning baseline of benchnpin."""


def main() -> None:
    """Serve standard input until it ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # benchnpin prints
    os.environ.update(MPLBACKEND="Agg", SDL_VIDEODRIVER="dummy")
    warnings.simplefilter("ignore")
    from benchnpin.common.metrics.task_driven_metric import TaskDrivenMetric
    from benchnpin.environments.area_clearing.area_clearing import AreaClearingEnv

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
        answers.write(json.dumps(tell, default=_plain) + "\n")
        answers.flush()


def _room(env: Any, info: dict[str, Any]) -> dict[str, Any]:
    """What does not change in an episode, and the pushes among which the baseline chooses."""
    from benchnpin.common.geometry.polygon import create_polygon_from_line

    return {
        "area": env.boundary_vertices,
        "limits": [max(abs(v[k]) for v in env.outer_boundary_vertices) for k in range(2)],
        "edges": [list(line.coords) for line in env.boundary_goals],
        "fixed": [*(create_polygon_from_line(w)[:4] for w in env.walls), *env.static_obstacles],
        "speed": env.target_speed,
        "turn": env.max_yaw_rate_step,
        "pushes": [[_push(box, line) for line in env.boundary_goals] for box in info["obs"]],
    }


def _push(box: Any, line: Any) -> list[list[float]]:
    """``(3, 2)``: from 2 m behind a box over the nearest point of an edge, as the policy GTSP of
    Bench-Push plans it."""
    from shapely import Polygon, shortest_line

    (x, y), (u, v) = shortest_line(Polygon(box).buffer(-0.4), line).coords
    length = max(((x - u) ** 2 + (y - v) ** 2) ** 0.5, 1e-9)
    return [[x + 2.0 * (x - u) / length, y + 2.0 * (y - v) / length], [x, y], [u, v]]


def _plain(value: Any) -> Any:
    """Arrays and numbers of numpy."""
    return value.tolist()


if __name__ == "__main__":
    main()
