"""What went wrong in a recorded run: refusals, failed jobs, fallbacks, collisions, warnings."""

from collections.abc import Container
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from push_model.jobs import JobError
from push_record.bag import ending, older_types, read_bag
from push_record.collisions import Collisions
from push_record.contents import BagContents

_FALLBACK = 4  # mode of ControllerStatus
_MOST = 500  # faults that are kept


@dataclass(frozen=True)
class Fault:
    """time: [s], nan if it belongs to no time. kind: e.g. ``refusal``; where: topic, node or
    bodies; text: what was said."""

    time: float
    kind: str
    where: str
    text: str


class _Wanted(Container[str]):
    def __contains__(self, topic: object) -> bool:
        ends = ("/job_state", "/controller/status", "/contacts", "/diagnostics")
        return str(topic).endswith(ends)


def faults_of(bag: Path, contents: BagContents) -> list[Fault]:
    """All faults of a bag, in the order in which they were recorded; the first few hundred."""
    reader = _Reader(Collisions(contents.collisions.robots, contents.collisions.objects))
    for record in read_bag(bag, cast(set[str], _Wanted())):
        if len(reader.found) >= _MOST:
            break
        kind = record.topic.rpartition("/")[2]
        getattr(reader, f"take_{kind}")(record.topic, 1e-9 * record.stamp, record.message)
    faults = reader.found
    for space, job in contents.jobs.items():
        if job.unfinished:
            text = f"the recording ends in the state {job.unfinished}; the job had not ended"
            faults.append(Fault(job.states[-1].time, "no end", f"{space}job_state", text))
    for kind in older_types(bag):
        text = "recorded with another version of this message; fields that it lacks are 0 or empty"
        faults.append(Fault(float("nan"), "another version", kind, text))
    end = ending(bag)
    if end.trouble:
        faults.append(Fault(end.time, end.trouble, bag.name, end.text))
    return faults


class _Reader:
    def __init__(self, collisions: Collisions) -> None:
        self.found: list[Fault] = []
        self._collisions = collisions
        self._refusals: dict[str, int] = {}
        self._ended: dict[str, int] = {}
        self._modes: dict[str, int] = {}
        self._failures: dict[str, int] = {}
        self._warned: dict[str, str] = {}

    def take_job_state(self, topic: str, time: float, m: Any) -> None:
        if int(m.refusals) > self._refusals.get(topic, 0):
            code = _name_of(int(m.refusal_code))
            self.found.append(Fault(time, "refusal", topic, f"{code}: {m.refusal}"))
        self._refusals[topic] = int(m.refusals)
        idle = str(m.state_name) == "IDLE" and int(m.job) > 0
        if idle and int(m.error_code) and self._ended.get(topic) != int(m.job):
            code = _name_of(int(m.error_code))
            self.found.append(Fault(time, "failed job", topic, f"{code}: {m.reason}"))
        if idle:
            self._ended[topic] = int(m.job)

    def take_status(self, topic: str, time: float, m: Any) -> None:
        mode, failures = int(m.mode), int(m.failures)
        if mode == _FALLBACK and self._modes.get(topic) != _FALLBACK:
            self.found.append(Fault(time, "fallback", topic, str(m.reason)))
        elif failures > self._failures.get(topic, 0):
            text = f"a solve failed ({failures} so far): {m.reason}"
            self.found.append(Fault(time, "failed solve", topic, text))
        self._modes[topic], self._failures[topic] = mode, failures

    def take_contacts(self, topic: str, time: float, m: Any) -> None:
        before = self._counts()
        for a, b in zip(m.body_a, m.body_b, strict=True):
            self._collisions.take(time, [a], [b])
            now = self._counts()
            if now != before:
                self.found.append(Fault(time, "collision", f"{a}, {b}", "bodies touched"))
            before = now

    def take_diagnostics(self, topic: str, time: float, m: Any) -> None:
        for status in m.status:
            name, text = str(status.name), str(status.message)
            level = status.level if isinstance(status.level, int) else bytes(status.level)[0]
            if level and self._warned.get(name) != text:
                kind = "warning" if level == 1 else "error"
                self.found.append(Fault(time, kind, name, text))
            self._warned[name] = text if level else ""

    def _counts(self) -> tuple[int, int, int]:
        c = self._collisions
        return c.between_robots, c.with_walls, c.between_objects


def _name_of(code: int) -> str:
    try:
        return JobError(code).name
    except ValueError:
        return f"code {code}"
