"""Continues a job after the node that owns it has died and was restarted. No ROS here.

During a job, everything that is needed to continue it is stored (``job_memory.py``). The restarted
node continues the job only under these conditions: the run of the world is the same, its clock has
not jumped back, not much time has passed, and object and robots have hardly moved. While the node
is away, the robots do not move, because they receive no commands.
"""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.jobs import GoalRefused, JobError
from push_ros.job_memory import JobMemory, KeptJob

_EVERY = 0.2  # [s] of pose time between two times at which a job is kept
_LONGEST = 60.0  # [s] of pose time after which a job is not continued
PATIENCE = 30.0
"""[s] that a restarted node waits until its job can be continued."""
_MOST_RESTARTS = 3  # of the node during one job, which may be the cause
_ITEM_WAY, _ITEM_TURN = 0.1, 0.5  # [m], [rad] that the object may have moved meanwhile
_ROBOT_WAY = 0.2  # [m] that a robot may have moved meanwhile: it stops after 0.2 s


Bodies = Callable[[], Mapping[str, Array]]
"""Poses ``(3,)`` [m, m, rad] of object and robots that are seen, by name; asked for when needed."""


class JobKeeper:
    """The job memory of one node.

    pending: the job of the node that died, as long as the restarted node has not continued it.
    """

    def __init__(
        self, memory: JobMemory, team: tuple[str, ...], further: Collection[str] = ()
    ) -> None:
        """team: object, then robots. further: objects that a job may be about instead."""
        self._memory, self._team = memory, team
        self._current: KeptJob | None = None
        self._seen: tuple[float, str, Bodies] = (-math.inf, "", dict)
        self.pending: KeptJob | None = None
        kept = memory.read()
        items = (team[0], *further)
        if kept is not None and kept.team[1:] == team[1:] and kept.team[0] in items:
            self._team = kept.team
            self.pending = replace(kept, restarts=kept.restarts + 1)
        memory.write(self.pending)

    @property
    def item(self) -> str:
        """The object of the job."""
        return self._team[0]

    def use(self, item: str) -> None:
        """The next job is about this object."""
        self._team = (item, *self._team[1:])

    def begin(
        self,
        job: int,
        goal: bytes,
        targets: tuple[Array, ...],
        times: tuple[float, ...] = (),
        plan_only: bool = False,
    ) -> None:
        """A job begins; see ``KeptJob``. One of the same number goes on."""
        before = self.pending or self._current
        restarts = before.restarts if before is not None and before.job == job else 0
        self.pending = None
        poses = tuple(tuple(float(v) for v in t) for t in targets)
        self._current = KeptJob(
            self._team, job, goal.hex(), poses, times, plan_only, restarts=restarts
        )
        self._keep(self._current, 0)

    def executed(self) -> None:
        """The plan of the job is carried out: a restarted node does so, too."""
        if self._current is not None:
            self._keep(replace(self._current, plan_only=False), 0)

    def end(self) -> None:
        """There is no job any more."""
        if self._current is not None or self.pending is not None:
            self._current = self.pending = None
            self._memory.write(None)

    def see(self, stamp: float, world: str, bodies: Bodies, reached: int) -> None:
        """Keep the job under way as it stands in a frame of a stamp [s]. reached: targets."""
        self._seen = stamp, world, bodies
        job = self._current
        if job is not None and not 0.0 <= stamp - job.stamp < _EVERY:
            self._keep(job, reached)

    def _keep(self, job: KeptJob, reached: int) -> None:
        """As the job stands in the newest frame."""
        stamp, world, seen = self._seen
        bodies = seen() if self._memory.keeps else {}
        rows = tuple((n, float(p[0]), float(p[1]), float(p[2])) for n, p in bodies.items())
        self._current = job = replace(job, stamp=stamp, world=world, bodies=rows)
        left = job.targets[min(reached, len(job.targets) - 1) :] if not job.times else job.targets
        self._memory.write(replace(job, targets=left))

    def judge(self, stamp: float, world: str, bodies: Mapping[str, Array]) -> KeptJob | None:
        """The pending job, if it can be continued now. None if more frames are needed to decide.

        stamp: [s] of the frame. world: run of the world. bodies: poses ``(3,)`` by name.

        Raises
        ------
        GoalRefused: the job must not be continued.
        """
        job = self.pending
        if job is None:
            return None
        if stamp < job.stamp or (world and job.world and world != job.world):
            raise GoalRefused(
                JobError.CLOCK_RESET,
                "the world was reset while the node was away; send the goal again",
            )
        if job.times:
            raise _forgotten("a trajectory with times cannot be continued")
        if job.restarts > _MOST_RESTARTS:
            raise _forgotten(f"the node has died {job.restarts} times during this job")
        if stamp - job.stamp > _LONGEST:
            raise _forgotten(
                f"the node was away for {stamp - job.stamp:.0f} s, longer than {_LONGEST:g} s"
            )
        if job.world and not world:
            return None
        item = self._team[0]
        before = {n: np.array(pose) for n, *pose in job.bodies}
        if item not in bodies:
            return None
        for name, pose in bodies.items():
            if name not in before:
                continue
            off = se2.between(before[name], pose)
            way, turn = float(np.hypot(off[0], off[1])), abs(float(off[2]))
            if way > (_ITEM_WAY if name == item else _ROBOT_WAY) or (
                name == item and turn > _ITEM_TURN
            ):
                raise _forgotten(
                    f"'{name}' was moved by {1e3 * way:.0f} mm and {turn:.2f} rad while the node "
                    "was away"
                )
        return job


def _forgotten(why: str) -> GoalRefused:
    text = f"the node was restarted and does not continue its job: {why}; send the goal again"
    return GoalRefused(JobError.JOB_FORGOTTEN, text)
