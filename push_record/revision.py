"""The state of the source, and of what it runs on, with which a bag or a study was made."""

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


def revision() -> str:
    """The git revision of the source tree, marked if there are changes; empty without git."""
    here = Path(__file__).resolve().parent
    try:
        text = subprocess.run(
            ["git", "-C", str(here), "describe", "--always", "--dirty", "--abbrev=12"],
            capture_output=True,
            text=True,
            timeout=5,
            check=True,
        ).stdout
    except (OSError, subprocess.SubprocessError):
        return ""
    return text.strip()


def versions() -> dict[str, str]:
    """Version of Python, the machine, and of each installed package that a run depends on."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found
