"""The pictures of README and docs that show one run each: ``make pictures``.

Plots of studies come from the studies; docs/results.md names the command of each.
"""

import base64
import contextlib
import io
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from PIL import Image

from push_view.playback_server import PlaybackServer
from tests.push_view.browser import CHROMIUM, Browser
from tests.system.test_page_live import Page

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
RUNS = (
    ("single", "env1-target1", ("env1-target1.png", "env1-target1.gif")),
    ("single", "env2-target2", ("env2-target2.png",)),
    ("single", "env3-target2", ("env3-target2.png",)),
    ("single", "beside-wall", ("beside-wall.png",)),
    ("group", "group-ellipse", ("group-ellipse.png", "group-ellipse.gif")),
    ("swarm", "swarm-square", ("swarm-square.gif",)),
    ("swarm", "swarm-walls", ("swarm-walls.gif",)),
    ("own-sensing", "own-sensing", ("own-sensing.gif",)),
)
"""System, scenario, and the pictures that are made of its run: of its whole path, or moving."""

FRAMES = 60  # of a moving picture
WIDTH = 420  # [px] of a moving picture
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
                if name.endswith(".png"):
                    shutil.copy(out / "trajectory.png", images / name)
                elif CHROMIUM is not None:
                    film(out / "bag", images / name)
        if CHROMIUM is None:
            print("without Chromium, pictures of the page are not made", file=sys.stderr)
            return 1
        for name, scenarios, fraction in PAGES:
            bags = [Path(folder) / s / "bag" for s in scenarios]
            if all(bag.is_dir() for bag in bags):
                shoot(bags, images / name, fraction)
            else:
                failed += 1
        failed += not several_objects(images, Path(folder))
        shoot_live(images / "view.png", Path(folder))
    return int(failed > 0)


def several_objects(images: Path, folder: Path) -> bool:
    """The run of the scenario ``rearrange``, its whole path and moving; whether it succeeded."""
    bag, report = folder / "rearrange", folder / "report"
    script = (
        "from pathlib import Path; from push_scenario.scenario import load_scenario; "
        "from push_study.experiments.rearrange import run_rearrangement; "
        f"row = run_rearrangement(load_scenario('rearrange'), record=Path({str(bag)!r})); "
        "raise SystemExit(not row['success'])"
    )
    words = ["-m", "planar_push", "report", str(bag), "--out", str(report)]
    for arguments in (["-c", script], words):
        if subprocess.run([sys.executable, *arguments], check=False).returncode:
            return False
    shutil.copy(report / "trajectory.png", images / "rearrange.png")
    film(bag, images / "rearrange.gif")
    return True


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


def film(bag: Path, picture: Path) -> None:
    """A moving picture of a bag, as the playback draws it; the last frame stays for a while."""
    with playback([bag], 1100, 760) as browser:
        browser.value("document.getElementById('zoom').style.display = 'none'")
        frames = []
        for k in range(FRAMES):
            seek(browser, k / (FRAMES - 1))
            frames.append(scene(browser))
        colours = palette([frames[0], frames[FRAMES // 2], frames[-1]])
        images = [f.quantize(palette=colours, dither=Image.Dither.NONE) for f in frames]
        durations = [80] * (FRAMES - 1) + [2000]
        images[0].save(picture, save_all=True, append_images=images[1:], duration=durations, loop=0)


def palette(frames: list[Image.Image]) -> Image.Image:
    """Colours of some frames; thin lines have theirs, too, however few their pixels are."""
    strip = Image.new("RGB", (frames[0].width, sum(f.height for f in frames)))
    for k, frame in enumerate(frames):
        strip.paste(frame, (0, k * frame.height))
    return strip.quantize(96, method=Image.Quantize.MAXCOVERAGE)


def scene(browser: Browser) -> Image.Image:
    """What the map shows now."""
    frame = "document.getElementById('scene').getBoundingClientRect()"
    x, y, width, height = browser.value(f"(r => [r.x, r.y, r.width, r.height])({frame})")
    clip = {"x": x, "y": y, "width": width, "height": height, "scale": WIDTH / width}
    shot = browser.call("Page.captureScreenshot", format="png", clip=clip)
    return Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB")


def seek(browser: Browser, fraction: float) -> None:
    """Go to a fraction of the time."""
    browser.value(
        "new Promise(done => { const wait = setInterval(() => {"
        "const s = document.getElementById('slider'); if (!s) return; clearInterval(wait);"
        f"s.value = {fraction} * s.max; s.dispatchEvent(new Event('input'));"
        "requestAnimationFrame(() => requestAnimationFrame(() => done(true))); }, 5); })"
    )


@contextlib.contextmanager
def playback(bags: list[Path], width: int, height: int) -> Iterator[Browser]:
    """A browser that shows bags."""
    server = PlaybackServer(bags, "127.0.0.1", 0)
    with tempfile.TemporaryDirectory() as profile:
        browser = Browser(profile, width, height)
        try:
            browser.open(f"http://127.0.0.1:{server.port}/")
            yield browser
        finally:
            browser.close()
            server.close()


def shoot(bags: list[Path], picture: Path, fraction: float) -> None:
    """The page with bags at a fraction of their time."""
    with playback(bags, 1280, 860) as browser:
        seek(browser, fraction)
        time.sleep(0.5)
        browser.picture(picture)


if __name__ == "__main__":
    sys.exit(main())
