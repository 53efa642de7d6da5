"""What only one run on this machine may have: a ROS domain, the world of a namespace.

A claim is a locked file, held until it is released or its process ends, however it ends. It is seen
at once, while discovery takes its time on a busy machine; for other machines there is only that.
"""

import contextlib
import fcntl
import itertools
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

_PREFIX = "planar_push_"
_MINE = "PLANAR_PUSH_DOMAIN"  # environment: the domain that this process or its parent has claimed
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
DOMAINS = 1, 100
"""First and last domain of runs in lockstep."""
OCCUPIED = (
    "a suite, `calibrate` or `doctor --drive` already runs in this ROS domain and namespace on "
    "this machine; stop it first"
)
_claims: dict[int, IO[str]] = {}
_turns = itertools.count()


def _locked(name: str) -> IO[str] | None:
    """The file of a claim; None where somebody else has it."""
    path = Path(tempfile.gettempdir()) / f"{_PREFIX}{name}.lock"
    try:
        file = open(path, opener=_open)  # noqa: SIM115  (it stays open)
    except OSError:
        return None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        return None
    return file


def _open(path: str, flags: int) -> int:
    """For reading: that is enough for a lock, also where another user has made the file."""
    try:
        return os.open(path, flags)
    except FileNotFoundError:
        return os.open(path, flags | os.O_CREAT, 0o644)


def claim_world(domain: str, space: str) -> IO[str] | None:
    """The claim to be the world of a namespace in a domain; to be closed. None: it is taken."""
    return _locked(f"world_{domain}{space.replace('/', '-')}")


def world_is_claimed(domain: str, space: str) -> bool:
    """Whether a process on this machine is the world of a namespace in a domain."""
    claim = claim_world(domain, space)
    if claim is None:
        return True
    claim.close()
    return False


def _has_world(domain: int) -> bool:
    """Whether a process on this machine is a world in a domain, of any namespace."""
    files = Path(tempfile.gettempdir()).glob(f"{_PREFIX}world_{domain}-*.lock")
    for name in (file.stem.removeprefix(_PREFIX) for file in files):
        claim = _locked(name)
        if claim is None:
            return True
        claim.close()
    return False


def runs_in_lockstep(domain: str) -> bool:
    """Whether somebody else on this machine has claimed a domain: what is sent there goes to that
    run, for example to a trial of a study."""
    if os.environ.get(_MINE) == domain:
        return False
    claim = _locked(f"domain_{domain}")
    if claim is None:
        return True
    claim.close()
    return False


@contextlib.contextmanager
def on_this_machine() -> Iterator[None]:
    """A context that is made in the block finds nodes on this machine only, and is found by them
    only, whatever ROS_AUTOMATIC_DISCOVERY_RANGE says."""
    before = os.environ.get(_RANGE)
    os.environ[_RANGE] = "LOCALHOST"
    try:
        yield
    finally:
        _restore(_RANGE, before)


def _restore(name: str, value: str | None) -> None:
    if value is None:
        os.environ.pop(name, None)
    else:
        os.environ[name] = value


def claim_domain() -> int:
    """Set ROS_DOMAIN_ID to one that no other run on this machine has claimed, and in which no suite
    runs; returns it. It is not that of the caller's environment, where a suite may run later.

    Other machines are shut out, whatever ROS_AUTOMATIC_DISCOVERY_RANGE says: nobody knows what runs
    there in the domain, and the robots of a lab would obey the run.

    The claim is a locked file, held until it is released or this process ends. Two lockstep runs on
    one domain would answer each other's frames. A domain that was released is not taken again at
    once: those who were killed in it are remembered there for a while.
    """
    first, last = DOMAINS
    count = last - first + 1
    theirs = os.environ.get("ROS_DOMAIN_ID")
    for _ in range(count):
        domain = first + (os.getpid() + next(_turns)) % count
        if str(domain) == theirs:
            continue
        file = _locked(f"domain_{domain}")
        if file is None:
            continue
        if _has_world(domain):
            file.close()
            continue
        _claims[domain] = file
        os.environ["ROS_DOMAIN_ID"] = os.environ[_MINE] = str(domain)
        os.environ[_RANGE] = "LOCALHOST"
        return domain
    raise RuntimeError(
        "all hundred ROS domains for lockstep runs are in use; wait until another run has ended"
    )


def release_domain(domain: int) -> None:
    """Give a claimed domain back."""
    _claims.pop(domain).close()


@contextlib.contextmanager
def own_domain() -> Iterator[int]:
    """A domain that nobody else on this machine has, while the block runs."""
    names = "ROS_DOMAIN_ID", _MINE, _RANGE
    before = {name: os.environ.get(name) for name in names}
    domain = claim_domain()
    try:
        yield domain
    finally:
        release_domain(domain)
        for name, value in before.items():
            _restore(name, value)
