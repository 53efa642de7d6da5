"""What an object and its robots do while they push along a trajectory, from ground truth."""

import numpy as np

from grasp_opt.object_trajectory import ObjectTrajectory
from push_model import se2
from push_model.arrays import Array
from push_model.specs import ObjectSpec
from push_study.given_grasp import GivenGrasp
from push_study.graph_run import LockstepRun
from push_study.pool import Row
from push_study.team_run import TeamTrace


class PushRecord:
    """Watches a ``GivenGrasp``, or a method made of it; ``run_team`` calls it at every tick.

    times ``(t,)`` [s]; objects, wanted ``(t, 3)``: poses of the centre of mass, as it is and as it
    is to be; lacking ``(t,)``: part of the wrench that the group law could not make.
    """

    def __init__(self, item: ObjectSpec, trajectory: ObjectTrajectory) -> None:
        """item: as believed. trajectory: of its centre of mass."""
        self._item, self._trajectory = item, trajectory
        self.times: list[float] = []
        self.objects: list[Array] = []
        self.wanted: list[Array] = []
        self.lacking: list[float] = []
        self.method: GivenGrasp | None = None

    def __call__(self, run: LockstepRun, now: float, poses: Array) -> None:
        """A tick at a time [s]; poses ``(1 + n, 3)`` of object and robots."""
        method = run.supervisor.method
        assert isinstance(method, GivenGrasp)
        self.method = method
        along = method.along(now)
        if along is None:
            return
        self.times.append(now)
        self.objects.append(self._item.mass_pose(poses[0]))
        self.wanted.append(self._trajectory.sample(along))
        last = method.job.last
        if last is not None and last.command is not None:
            self.lacking.append(float(last.command.lacking))

    def forces(self, trace: TeamTrace) -> Array:
        """``(t, n)`` [N] of the robots on the object, at ``times``."""
        felt = dict(zip(np.round(trace.force_times, 6).tolist(), trace.forces, strict=True))
        rows = [felt[t] for t in np.round(self.times, 6).tolist()]
        sizes: Array = np.linalg.norm(np.array(rows), axis=2)
        return sizes

    def figures(self, trace: TeamTrace) -> Row:
        """Means over the push; force_spread_n: standard deviation between robots at a moment."""
        if not self.times:
            return {}
        off = np.array(self.objects) - np.array(self.wanted)
        away = np.hypot(*off[:, :2].T)
        turned = np.abs([se2.wrap(float(a)) for a in off[:, 2]])
        forces = self.forces(trace)
        row: Row = {
            "push_duration_s": self.times[-1] - self.times[0],
            "position_error_m": float(away.mean()),
            "worst_position_error_m": float(away.max()),
            "orientation_error_rad": float(turned.mean()),
            "worst_orientation_error_rad": float(turned.max()),
            "force_n": float(forces.mean()),
            "force_spread_n": float(forces.std(axis=1).mean()),
            "greatest_force_n": float(forces.max(axis=1).mean()),
        }
        if self.lacking:
            row["lacking"] = float(np.mean(self.lacking))
        return row
