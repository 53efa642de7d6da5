"""A room of GCo's simulator for another process: a line of JSON in, a line of JSON out.

Runs with the Python of another environment, without this project, in the unchanged simulator of
yoraish/gco (MuJoCo). Asked for ``reset``, it builds a room; asked for ``move``, it drags the robots
to where it is told; asked for ``solve``, GCo itself plays, with the model that its authors trained
and the settings of their evaluation. It answers with where everything is, the time, the length of
the robots' ways, and whether anything touched an obstacle.
"""

import json
import math
import os
import sys
import tempfile
import time
import warnings
from typing import Any

STEPS = 7
"""Of the simulation, 3 ms each, in a move."""


def main() -> None:
    """Serve standard input until it ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # GCo prints
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    os.environ.update(one, MPLBACKEND="Agg", CUDA_VISIBLE_DEVICES="")
    warnings.simplefilter("ignore")
    import torch

    torch.set_num_threads(1)
    room: Any = None
    for line in sys.stdin:
        ask = json.loads(line)
        if "reset" in ask:
            if room is not None:
                raise RuntimeError("a process has one room")
            room = Room(ask["reset"])
            tell = room.tell()
        elif "solve" in ask:
            tell = room.solve(*ask["solve"])
        else:
            room.move(ask["move"])
            tell = room.tell()
        answers.write(json.dumps(tell) + "\n")
        answers.flush()


class Room:
    """One object, some robots, some round obstacles."""

    def __init__(self, problem: dict[str, Any]) -> None:
        """problem: the fields of ``problems.Problem``."""
        import random

        import mujoco
        import numpy as np
        import torch
        from gco.utils.transform_utils import Transform2
        from gco.world.objects import ObjectCircle, ObjectRectangle
        from gco.world.obstacles import ObstacleCircle
        from gco.world.robot import RobotDisk
        from gco.world.world import World

        def at(x: float, y: float, heading: float = 0.0) -> Any:
            return Transform2(t=torch.tensor([x, y]), theta=torch.tensor([heading]))

        random.seed(problem["seed"])
        np.random.seed(problem["seed"])
        torch.manual_seed(problem["seed"])
        self._problem = problem
        size, start = problem["size"], problem["start"]
        if problem["shape"] == "circle":
            item = ObjectCircle("object_1", radius=size[0])
        else:
            item = ObjectRectangle("object_1", width=size[0], height=size[1])
        robots = {
            RobotDisk(f"robot_{k + 1}", radius=0.05): at(*place)
            for k, place in enumerate(problem["robots"])
        }
        obstacles = {
            ObstacleCircle(f"obstacle_{k + 1}", radius=radius): at(x, y)
            for k, (x, y, radius) in enumerate(problem["obstacles"])
        }
        self.world = World(
            size=(1.0, 1.0),
            resolution=0.05,
            robots_with_pose_init=robots,
            obstacles_with_pose_init=obstacles,
            objects_with_pose_init={item: at(*start)},
            seed=problem["seed"],
            launch_viewer=False,
        )
        sim = self.world.simulator
        self.model, self.data = sim.model, sim.data
        mujoco.mj_forward(self.model, self.data)  # the viewer would have done this
        self._robots = [sim.robot_body_ids[f"robot_{k + 1}"] for k in range(len(robots))]
        self._item = sim.object_body_ids["object_1"]
        self._mocap = [
            self.model.body_mocapid[self.model.body(f"mocap_robot_{k + 1}").id]
            for k in range(len(robots))
        ]
        self._fixed = {
            self.model.body(f"obstacle_obstacle_{k + 1}").id for k in range(len(obstacles))
        }
        self._steps, self._ways, self.touched = 0, [0.0] * len(robots), False
        self._before = self._places()
        self._step, mujoco.mj_step = mujoco.mj_step, self._counted

    def _places(self) -> list[list[float]]:
        return [self.data.xpos[k][:2].tolist() for k in self._robots]

    def _counted(self, model: Any, data: Any, *more: Any) -> None:
        """A step of the simulation that is counted."""
        self._step(model, data, *more)
        self._steps += 1
        if self._fixed and not self.touched:
            for contact in data.contact:
                bodies = {int(model.geom_bodyid[g]) for g in contact.geom}
                if bodies & self._fixed and not bodies <= self._fixed | {0}:
                    self.touched = True
        if self._steps % STEPS == 0:
            now = self._places()
            for k, (a, b) in enumerate(zip(self._before, now, strict=True)):
                self._ways[k] += math.dist(a, b)
            self._before = now

    def move(self, targets: list[list[float]]) -> None:
        """Drag the robots evenly to targets, by ``STEPS`` steps, at the height of GCo's own."""
        import mujoco

        mocap = self.data.mocap_pos
        mocap[self._mocap, 2] = 0.5 * self.world.simulator.robot_height + 0.001
        begin = [mocap[k][:2].tolist() for k in self._mocap]
        for step in range(1, STEPS + 1):
            part = step / STEPS
            for k, (x, y), (u, v) in zip(self._mocap, begin, targets, strict=True):
                mocap[k][:2] = x + part * (u - x), y + part * (v - y)
            mujoco.mj_step(self.model, self.data)

    def tell(self) -> dict[str, Any]:
        """Where everything is, and what was measured so far."""
        w, _, _, z = self.data.xquat[self._item]
        x, y = self.data.xpos[self._item][:2]
        return {
            "object": [float(x), float(y), 2.0 * math.atan2(z, w)],
            "robots": self._places(),
            "time_s": self._steps * self.model.opt.timestep,
            "path_m": sum(self._ways),
            "touched": self.touched,
        }

    def solve(self, away: float, turned: float) -> dict[str, Any]:
        """Let GCo play until the object is within tolerances [m, rad], for at most 100 rounds of
        planning. Raises RuntimeError if it ends with an error, which GCo itself only prints."""
        from gco.config import Config
        from gco.planners.multi import iterative_push_planner
        from gco.tasks.tasks import ManipulationTask

        x, y, heading = self._problem["goal"]
        task = ManipulationTask()
        task.object_id = "object_1"
        task.target_pose = {"position": [x, y], "orientation": heading}
        simulated, pushes, play = 0.0, 0, self.world.apply_trajectories
        said: list[str] = []

        def timed(*args: Any, **more: Any) -> Any:
            nonlocal simulated, pushes
            began, pushes = time.process_time(), pushes + 1
            try:
                return play(*args, **more)
            finally:
                simulated += time.process_time() - began

        self.world.apply_trajectories = timed
        vars(iterative_push_planner)["print"] = lambda *words: said.append(
            " ".join(map(str, words))
        )
        with tempfile.TemporaryDirectory() as folder:
            settings = {
                "max_iterations": 100,
                "goal_tolerance_position": away,
                "goal_tolerance_orientation": turned,
                "min_push_distance": 0.02,
                "visualization_interval": 1,
                "save_visualizations": False,
                "visualize_planning": False,
                "output_dir": folder,
                "model_checkpoint": Config.checkpoints.c_r_flex,
                "model_type": "discrete",
                "persistent_simulator": True,
                "planner_type": "a_star",
            }
            planner = iterative_push_planner.IterativePushPlanner(self.world, params=settings)
            began = time.process_time()
            planner.plan_action_trajs(task, visualize=False)
            spent = time.process_time() - began - simulated
        if errors := [text for text in said if "Error during planning" in text]:
            raise RuntimeError(errors[0])
        why = next((text for text in said if "No path found" in text), "")
        rounds = len(planner.planning_history)
        return {**self.tell(), "pushes": pushes, "rounds": rounds, "why": why, "cpu_s": spent}


if __name__ == "__main__":
    main()
