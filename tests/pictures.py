"""The pictures of README and docs that show one run each: ``make pictures``.

Plots of studies come from the studies; docs/results.md names the command of each.
"""

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from push_view.playback_server import PlaybackServer
from tests.push_view.browser import CHROMIUM, Browser
from tests.system.test_page_live import Page

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
RUNS = (
    ("single", "env1-target1", ("env1-target1.png",)),
    ("single", "env2-target2", ("env2-target2.png",)),
    ("single", "env3-target2", ("env3-target2.png",)),
    ("group", "group-ellipse", ("group-ellipse.png", "group-ellipse.gif")),
    ("swarm", "swarm-square", ("swarm-square.gif",)),
    ("swarm", "swarm-walls", ("swarm-walls.gif",)),
)
"""System, scenario, and the pictures that are made of its run."""

PRODUCT = {".png": "trajectory.png", ".gif": "animation.gif"}
PAGES = (("play.png", ("env1-target1", "group-ellipse"), 0.6),)
"""Picture of a playback, the runs that it shows, and the fraction of the time at which it does."""


def main(images: Path = IMAGES) -> int:
    """Make all; 1 if one could not be made."""
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for system, scenario, names in RUNS:
            out = Path(folder) / scenario
            words = ["demo", system, "--scenario", scenario, "--lockstep", "--out", str(out)]
            print(f"{system}, {scenario}", flush=True)
            if subprocess.run(
                [sys.executable, "-m", "planar_push", *words], check=False
            ).returncode:
                failed += 1
                continue
            for name in names:
                shutil.copy(out / PRODUCT[Path(name).suffix], images / name)
        if CHROMIUM is None:
            print("without Chromium, pictures of the page are not made", file=sys.stderr)
            return 1
        for name, scenarios, fraction in PAGES:
            bags = [Path(folder) / s / "bag" for s in scenarios]
            if all(bag.is_dir() for bag in bags):
                shoot(bags, images / name, fraction)
            else:
                failed += 1
        shoot_live(images / "view.png", Path(folder))
    return int(failed > 0)


def shoot_live(picture: Path, folder: Path) -> None:
    """The live view in the middle of a push."""
    page = Page(folder, 1280, 860, touch=False)
    try:
        page.start("single", "env1-target1")
        page.fill(x="1.3", y="0.75", theta="0.0")
        page.value("document.querySelector('#typed button[value=go]').click()")
        page.until("document.getElementById('state').textContent === 'PUSHING'", 60.0)
        time.sleep(12.0)
        page.browser.picture(picture)
    finally:
        page.close()


def shoot(bags: list[Path], picture: Path, fraction: float) -> None:
    """The page with bags at a fraction of their time."""
    server = PlaybackServer(bags, "127.0.0.1", 0)
    with tempfile.TemporaryDirectory() as profile:
        browser = Browser(profile, 1280, 860)
        try:
            browser.open(f"http://127.0.0.1:{server.port}/")
            browser.value(
                "new Promise(done => { const wait = setInterval(() => {"
                "const s = document.getElementById('slider'); if (!s) return; clearInterval(wait);"
                f"s.value = {fraction} * s.max; s.dispatchEvent(new Event('input'));"
                "setTimeout(done, 500, true); }, 50); })"
            )
            browser.picture(picture)
        finally:
            browser.close()
            server.close()


if __name__ == "__main__":
    sys.exit(main())
