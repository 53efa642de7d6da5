"""Steps a swarm's job without ROS, as a notebook does."""

import numpy as np

from push_study.group_world import TICK


def drive(job, world, item, limit, meanwhile=None):
    """Until a job that was begun ends, or a time [s]: poses ``(t, 1 + n, 3)`` of object and robots
    every 0.2 s, and how long [s] each phase took."""
    ways, none, phases, tick = [], np.zeros((0, 3)), {}, 0
    while world.time < limit and job.busy:
        if meanwhile is not None:
            meanwhile(world.time)
        seen, robots = world.see()
        here = dict(zip(world.names, robots, strict=True))
        twists = job.step(world.time, item.mass_pose(seen), here, none)
        if job.last is not None:
            name = job.last.phase.value
            phases[name] = phases.get(name, 0.0) + TICK
        if tick % 10 == 0:
            ways.append(np.vstack([*world.truth()]))
        world.step(np.array([twists[n] for n in world.names]))
        tick += 1
    return np.array(ways), phases
