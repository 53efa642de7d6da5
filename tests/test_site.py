"""``make docs``: the site with its API pages is built without a warning."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long
ROOT = Path(__file__).resolve().parents[1]


def test_the_site_is_built_without_a_warning_and_needs_no_network(tmp_path):
    words = ["-q", "-W", "--keep-going", "-b", "html", "-d", str(tmp_path / "trees")]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *words, str(ROOT / "docs"), str(tmp_path / "site")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    site = tmp_path / "site"
    for page in ("index", "start", "how-to", "equations", "single-robot", "api/push_job"):
        text = (site / f"{page}.html").read_text()
        loaded = re.findall(r'<(?:script|link|img)[^>]+(?:src|href)="(https?://[^"]+)"', text)
        assert not loaded, f"{page}: loads {loaded}"
    assert "push_job.method.Method.assess" in (site / "api/push_job.html").read_text()
