"""The state of a job, stored so that the node can continue the job after a restart.

The launcher gives each node that it may restart a memory: an anonymous file in RAM, which the
process inherits. The file outlives the node and disappears with the launcher. It therefore never
contains a job of an earlier session. A node that was started in another way stores nothing.
"""

import json
import os
import zlib
from dataclasses import asdict, dataclass

VARIABLE = "PLANAR_PUSH_JOB_MEMORY"
"""Environment variable with the file descriptor."""
_NAME = "planar_push_job"


@dataclass(frozen=True)
class KeptJob:
    """A job under way.

    team: its object, then its robots. job: its number; goal: as it was sent, serialised, in
    hexadecimal. targets: poses [m, m, rad] still to be reached, headings nan where any will do;
    times: [s] of a trajectory, empty otherwise. plan_only: whether it is to be planned and not
    executed. stamp: [s] of the frame at which this was kept; world: which run of the world it was
    in; bodies: where [m, m, rad] object and robots were. restarts: of the node during the job.
    """

    team: tuple[str, ...]
    job: int
    goal: str
    targets: tuple[tuple[float, ...], ...]
    times: tuple[float, ...] = ()
    plan_only: bool = False
    stamp: float = 0.0
    world: str = ""
    bodies: tuple[tuple[str, float, float, float], ...] = ()
    restarts: int = 0


class JobMemory:
    """descriptor: of the file; None keeps nothing."""

    def __init__(self, descriptor: int | None = None) -> None:
        self._descriptor = descriptor

    @property
    def keeps(self) -> bool:
        """Whether anything is kept."""
        return self._descriptor is not None

    @classmethod
    def of_process(cls) -> "JobMemory":
        """The memory that this process was started with."""
        given = os.environ.get(VARIABLE, "")
        try:
            link = os.readlink(f"/proc/self/fd/{int(given)}")
        except (ValueError, OSError):
            return cls()
        return cls(int(given) if _NAME in link else None)

    def write(self, kept: KeptJob | None) -> None:
        """Keep a job in the place of the one before; None: there is none."""
        if self._descriptor is None:
            return
        os.ftruncate(self._descriptor, 0)
        if kept is not None:
            data = json.dumps(asdict(kept)).encode()
            os.pwrite(self._descriptor, zlib.crc32(data).to_bytes(4, "big") + data, 0)

    def read(self) -> KeptJob | None:
        """The job that was kept last; None where there is none, or where it was not kept whole."""
        if self._descriptor is None:
            return None
        data = os.pread(self._descriptor, os.fstat(self._descriptor).st_size, 0)
        if len(data) <= 4 or zlib.crc32(data[4:]) != int.from_bytes(data[:4], "big"):
            return None
        values = json.loads(data[4:])
        for name in ("team", "times"):
            values[name] = tuple(values[name])
        for name in ("targets", "bodies"):
            values[name] = tuple(tuple(row) for row in values[name])
        return KeptJob(**values)


def new_memory() -> int:
    """Descriptor of an empty memory; to be closed."""
    return os.memfd_create(_NAME)
