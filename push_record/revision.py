"""The state of the source, and of what it runs on, with which a bag or a study was made."""

import hashlib
import platform
import subprocess
from importlib import metadata
from pathlib import Path

_PACKAGES = (
    "planar-push",
    "push-msgs",
    "ros-jazzy-rclpy",
    "numpy",
    "scipy",
    "numba",
    "pybullet",
    "ompl",
    "casadi",
    "osqp",
    "daqp",
)
"""What the numbers of a run depend on."""
_DIRTY = "-dirty"


def revision() -> str:
    """The git revision of the source tree; empty without git.

    If there are changes that are not committed, a hash of them follows, and ``-dirty``. Files that
    git does not know are no changes.
    """
    try:
        text = _git("describe", "--always", "--dirty", "--abbrev=12").decode().strip()
        if not text.endswith(_DIRTY):
            return text
        changes = _git("diff", "HEAD", "--binary", "--no-color", "--no-ext-diff")
    except (OSError, subprocess.SubprocessError):
        return ""
    number = hashlib.sha256(changes).hexdigest()[:8]
    return f"{text.removesuffix(_DIRTY)}-{number}{_DIRTY}"


def _git(*words: str) -> bytes:
    here = str(Path(__file__).resolve().parent)
    command = ["git", "-C", here, *words]
    return subprocess.run(command, capture_output=True, timeout=5, check=True).stdout


def versions() -> dict[str, str]:
    """Version of Python, the machine, and of each installed package that a run depends on."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found
