"""The state of the source with which a bag or a study was made."""

import subprocess
from pathlib import Path


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
