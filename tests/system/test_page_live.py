"""The page in a browser against live suites: everything that it offers, by mouse and by finger."""

import math
import re
import time

import pytest

from tests.push_view.browser import CHROMIUM, Browser
from tests.system.processes import command, until

pytestmark = [
    pytest.mark.live,
    pytest.mark.long,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here"),
]
WIDE, PHONE = (1280, 800, False), (390, 800, True)


class Page:
    """A page in a browser, and the viewer that serves it, which starts suites for it."""

    def __init__(self, folder, width, height, touch):
        self.viewer = command("view", "--port", "0", stdout=-1)
        url = re.search(r"http://\S+", self.viewer.stdout.readline()).group()
        self.browser = Browser(folder / "profile", width, height)
        self.touch = touch
        if touch:
            self.browser.call("Emulation.setTouchEmulationEnabled", enabled=True)
            self.browser.call(
                "Emulation.setDeviceMetricsOverride",
                width=width, height=height, deviceScaleFactor=2, mobile=True,
            )  # fmt: skip
        self.browser.open(url)

    def value(self, expression):
        return self.browser.value(expression)

    def until(self, expression, limit=20.0):
        assert until(lambda: self.value(expression), limit), self.value("document.body.innerText")

    def text(self, element):
        return self.value(f"document.getElementById('{element}').textContent")

    def click(self, element):
        self.value(f"document.getElementById('{element}').click()")

    def choose(self, tool):
        self.value(f"document.querySelector('input[name=tool][value={tool}]').click()")

    def fill(self, **values):
        for name, value in values.items():
            self.value(f"document.getElementById('{name}').value = {value!r}")

    def start(self, system, scenario):
        self.until("!document.getElementById('world').hidden")
        self.fill(system=system, scenario=scenario)
        self.click("start")
        self.until("document.getElementById('trouble').hidden", 60.0)
        self.value(EXPOSE)

    def pixel(self, x, y):
        """Where a place [m] is on the page [CSS pixels], once the page has settled."""
        before, now = None, self._pixel(x, y)
        while now != before:
            time.sleep(0.15)
            before, now = now, self._pixel(x, y)
        return now

    def _pixel(self, x, y):
        """It is scrolled into view, no further than needed: what the page shows below the map comes
        and goes, and a page that is scrolled to its end moves with it."""
        return self.value(
            "(async () => { const c = document.getElementById('scene');"
            "c.scrollIntoView({block: 'nearest'});"
            "await new Promise(requestAnimationFrame);"
            "const {Scene, fitted, toPixels} = await import('/scene.js');"
            "const b = c.getBoundingClientRect(), r = c.width / b.width;"
            "const f = fitted(window.extent, c.width, c.height);"
            f"const [u, v] = toPixels(f, {x}, {y}); return [b.left + u / r, b.top + v / r]; }})()"
        )

    def drag(self, start, end):
        """From one pixel to another, by mouse or by finger."""
        points = [[s + k / 4 * (e - s) for s, e in zip(start, end, strict=True)] for k in range(5)]
        if self.touch:
            for kind, (x, y) in zip(["touchStart", *["touchMove"] * 4], points, strict=True):
                self.browser.call(
                    "Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y}]
                )
            self.browser.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
            return
        for kind, at in zip(["mousePressed", *["mouseMoved"] * 4], points, strict=True):
            self.browser.mouse(kind, *at)
        self.browser.mouse("mouseReleased", *points[-1])

    def drag_goal(self, x, y, theta, length=70.0):
        start = self.pixel(x, y)
        end = (start[0] + length * math.cos(theta), start[1] - length * math.sin(theta))
        self.drag(start, end)

    def shown_pose(self, name):
        """[m, m, rad] of a body as the page has it."""
        return self.value(f"window.newest['{name}']")

    def send(self, x, y, theta):
        """A typed goal."""
        self.fill(x=f"{x:.3f}", y=f"{y:.3f}", theta=f"{theta:.3f}")
        self.value("document.querySelector('#typed button[value=go]').click()")
        self.until("document.getElementById('answer').textContent === 'the goal is accepted'", 30.0)

    def reached(self, limit=120.0):
        self.until("document.getElementById('state').textContent === 'IDLE'", limit)
        assert "reached" in self.text("reason") or "goal" in self.text("reason")

    def close(self):
        self.browser.close()
        self.viewer.terminate()
        self.viewer.wait(20)


# The newest poses and the map's extent, from a stream of the test's own.
EXPOSE = """new Promise(done => { const s = new EventSource('events'); window.newest = {};
  let names = [];
  s.addEventListener('map', e => { window.extent = JSON.parse(e.data).extent; });
  s.addEventListener('bodies', e => { names = JSON.parse(e.data).names; });
  s.addEventListener('poses', e => { const p = JSON.parse(e.data);
    names.forEach((n, i) => { window.newest[n] = [p.x[i] / 1e4, p.y[i] / 1e4, p.a[i] / 1e3]; });
    if (window.extent) done(true); }); })"""


@pytest.fixture(params=[WIDE, PHONE], ids=["1280", "390"])
def page(request, tmp_path):
    page = Page(tmp_path, *request.param)
    yield page
    errors = page.browser.errors
    page.close()
    assert errors == []


def far(a, b):
    return math.dist(a[:2], b[:2])


def test_single_by_everything_that_the_page_offers(page):
    page.start("single", "short")
    begun = page.shown_pose("box")
    assert page.touch != ("Escape" in page.text("hint"))
    # a goal by drag, planned first, then carried out
    page.click("preview")
    page.drag_goal(0.1, 0.04, 0.1)
    page.until("!document.getElementById('execute').hidden", 30.0)
    assert page.shown_pose("box") == begun
    page.click("execute")
    page.until("document.getElementById('state').textContent === 'PUSHING'", 60.0)
    pause_and_go_on(page, "box")
    page.reached()
    assert far(page.shown_pose("box"), (0.1, 0.04)) < 0.02
    assert page.value("document.querySelectorAll('.chart').length") >= 3
    page.click("preview")
    displace(page, "box")
    send_and_cancel(page, 0.1, 0.0)
    reset(page, "box", begun)
    kill(page, "epuck1", (0.4, 0.4))


@pytest.mark.parametrize(
    ("system", "scenario", "item"),
    [("group", "group-ellipse", "plate"), ("swarm", "swarm-square", "square")],
)
def test_group_and_swarm_by_everything_that_the_page_offers(page, system, scenario, item):
    page.start(system, scenario)
    begun = x, y, theta = page.shown_pose(item)
    page.send(x + 0.3, y + 0.1, theta)
    page.until("document.querySelectorAll('#legend button').length > 4", 60.0)
    assert until(lambda: far(page.shown_pose(item), begun) > 0.02, 120.0), page.text("state")
    pause_and_go_on(page, item)
    page.reached(240.0)
    assert far(page.shown_pose(item), (x + 0.3, y + 0.1)) < 0.03
    page.drag_goal(x + 0.5, y, theta)
    page.until("document.getElementById('state').textContent !== 'IDLE'")
    page.reached(240.0)
    assert far(page.shown_pose(item), (x + 0.5, y)) < 0.04  # a pixel of the narrow page is 1 cm
    reset(page, item, begun)
    displace(page, item)
    send_and_cancel(page, x + 0.3, y + 0.1)
    robot = page.value("Object.keys(window.newest)[0]")
    kill(page, robot, (x + 0.8, y + 0.5))


def pause_and_go_on(page, item):
    page.click("pause")
    page.until("document.getElementById('trouble').textContent === 'the suite is paused'")
    time.sleep(0.3)  # a picture that was under way
    still = page.shown_pose(item)
    time.sleep(0.5)
    assert page.shown_pose(item) == still
    page.click("pause")


def displace(page, item):
    """Move an object by hand."""
    page.choose("move")
    x, y, _ = page.shown_pose(item)
    page.drag(page.pixel(x, y), page.pixel(x, y + 0.2))
    there = (x, y + 0.2)
    assert until(lambda: far(page.shown_pose(item), there) < 0.02, 5.0), page.text("answer")
    page.choose("goal")


def send_and_cancel(page, x, y):
    """Cancel is in sight, wherever the page is scrolled to."""
    page.send(x, y, 0.0)
    for place in ("0", "document.body.scrollHeight"):
        page.value(f"scrollTo(0, {place})")
        top, bottom, height = page.value(
            "(r => [r.top, r.bottom, innerHeight])"
            "(document.getElementById('cancel').getBoundingClientRect())"
        )
        assert top >= 0.0 and bottom <= height
    page.click("cancel")
    page.until("document.getElementById('state').textContent === 'IDLE'")


def reset(page, item, begun):
    page.click("reset")
    assert until(lambda: far(page.shown_pose(item), begun) < 0.002, 5.0)


def kill(page, robot, nobody):
    """A robot fails; a click where there is none is told."""
    page.choose("kill")
    empty = page.pixel(*nobody)
    page.drag(empty, empty)
    page.until("document.getElementById('answer').textContent.includes('no robot')")
    there = page.pixel(*page.shown_pose(robot)[:2])
    page.drag(there, there)
    page.until("document.getElementById('answer').textContent.includes('obeys no more')")
