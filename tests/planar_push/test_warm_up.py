"""What ``planar-push warm-up`` compiles, and what is compiled after it: nothing."""

import gc
import os
import subprocess
import sys

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from planar_push import warm_up
from push_gym.vector_env import PlanarPushVectorEnv
from push_job.method import Arena, Seen, Task, method_spec
from push_model.belief import Belief
from push_model.point_push import driven
from push_scenario.scenario import load_scenario
from push_study.experiments import pusht
from sim_bridge.planar_world import PlanarWorld

_STEP = 0.01  # [s]
_IN_A_NEW_PROCESS = """
import importlib, pathlib, pkgutil, tomllib
from numba.core.dispatcher import Dispatcher
from planar_push import warm_up

warm_up.run(None)
project = tomllib.loads(pathlib.Path("pyproject.toml").read_text())
found = {}
for package in project["tool"]["setuptools"]["packages"]:
    for info in pkgutil.iter_modules(importlib.import_module(package).__path__, package + "."):
        if package != "benchmarks" and not info.ispkg and not info.name.endswith("__main__"):
            for thing in vars(importlib.import_module(info.name)).values():
                if isinstance(thing, Dispatcher):
                    found[thing.py_func.__module__ + "." + thing.py_func.__qualname__] = thing
print("functions:", len(found))
for name, function in sorted(found.items()):
    if not function.signatures and function.targetoptions.get("inline") != "always":
        print("not compiled:", name)
"""


def compiled():
    """Every kernel with each of the argument types that it is compiled for."""
    kernels = [o for o in gc.get_objects() if isinstance(o, Dispatcher)]
    return {(k.py_func.__module__, k.py_func.__name__, s) for k in kernels for s in k.signatures}


def pushed(name, method, seconds):
    """Begin the job of a scenario with a method in the planar world."""
    scenario = load_scenario(name)
    robots = {n: spec for n, (spec, _) in scenario.robots.items()}
    item, spec = scenario.object()
    belief = Belief({item: spec}, robots)
    made = method_spec(method).make(Arena(scenario.grid, robots, item, spec))
    with PlanarWorld(scenario.environment, scenario.robots, scenario.objects) as world:
        made.begin(Task((scenario.goal,)), belief)
        for k in range(round(seconds / _STEP)):
            poses = world.poses()
            seen = Seen(k * _STEP, poses[item], {n: poses[n] for n in robots})
            for robot, command in made.step(seen, belief).commands.items():
                world.command(robot, *command[:2])
            made.report(seen)
            world.step(round(_STEP / world.time_step))
    return made.status


@pytest.mark.long
def test_after_it_nothing_is_compiled():
    assert warm_up.run(None) == 0
    before = compiled()
    assert len(before) > 30
    for name, method in (
        ("short", "one-robot"),
        ("group-ellipse", "group"),
        ("swarm-square", "swarm"),
        ("swarm-walls", "swarm"),
        ("own-sensing", "own-sensing"),
    ):
        assert pushed(name, method, 20.0).phase > 0
        assert sorted(compiled() - before) == [], name
    rooms = PlanarPushVectorEnv(2)
    rooms.reset(seed=1)
    rooms.step(np.ones(rooms.action_space.shape))
    chooser = pusht.planner()
    chooser.target(pusht.to_mass(np.array([0.3, 0.3, 0.5])), np.array([0.1, 0.1, 0.0, 0.0]))
    driven(pusht.DISC, np.zeros(4), np.ones(2), 1)
    assert sorted(compiled() - before) == []


@pytest.mark.long
def test_it_compiles_every_kernel_where_no_cache_is_yet(tmp_path):
    """Kernels that others inline are no functions of their own."""
    run = subprocess.run(
        [sys.executable, "-c", _IN_A_NEW_PROCESS],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    assert int(run.stdout.split("functions: ")[1].split()[0]) > 150
    assert "not compiled: " not in run.stdout, run.stdout
