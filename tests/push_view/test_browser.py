"""The page in a browser: what it shows, and what the mouse does. Skipped without Chromium."""

import math
import time

import numpy as np
import pytest

from push_msgs.msg import JobState
from push_ros.conversions import grid_to_ros
from push_view.page_server import PageServer
from tests.push_view.browser import CHROMIUM, Browser
from tests.push_view.page_client import Page, Suite

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here")


_BOX = "document.getElementById('{}').getBoundingClientRect()"


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    browser = Browser(tmp_path_factory.mktemp("profile"))
    yield browser
    browser.close()


class Watched:
    """The page of a suite in a browser; ROS goes on while the browser is asked."""

    def __init__(self, browser, page, scenario):
        self.browser, self.page, self.scenario = browser, page, scenario
        page.suite.maps.publish(grid_to_ros(scenario.grid, 1.0))
        page.away(lambda: browser.open(f"http://127.0.0.1:{page.server.port}/"))
        self.until("document.getElementById('trouble').hidden")
        self.until("document.getElementById('numbers').textContent.includes('1, 1')")

    def value(self, expression):
        return self.page.away(lambda: self.browser.value(expression))

    def until(self, expression, limit=8.0):
        end = time.monotonic() + limit
        while not self.value(expression):
            assert time.monotonic() < end, f"{expression}: {self.value('document.body.innerText')}"
            self.page.until(lambda: False, 0.05)

    def text(self, element):
        return self.value(f"document.getElementById('{element}').textContent")

    def pixel(self, x, y):
        """Where a place [m] is on the page [CSS pixels]."""
        box = self.value(
            "(b => [b.left, b.top, b.width, b.height])"
            "(document.getElementById('scene').getBoundingClientRect())"
        )
        x0, x1, y0, y1 = self.scenario.grid.extent
        scale = 0.96 * min(box[2] / (x1 - x0), box[3] / (y1 - y0))
        u = box[0] + box[2] / 2 + scale * (x - (x0 + x1) / 2)
        return u, box[1] + box[3] / 2 - scale * (y - (y0 + y1) / 2)

    def mouse(self, kind, at, button="left"):
        self.page.away(lambda: self.browser.mouse(kind, *at, button))

    def drag(self, start, length, angle, steps=4, button="left"):
        self.mouse("mouseMoved", start)
        self.mouse("mousePressed", start, button)
        for i in range(1, steps + 1):
            d = length * i / steps
            end = (start[0] + d * math.cos(angle), start[1] - d * math.sin(angle))
            self.mouse("mouseMoved", end, button)
        return end

    def goals(self, wait=0.4):
        self.page.until(lambda: False, wait)
        return self.page.suite.goals["/"]


@pytest.fixture
def shown(ros, scenario, browser):
    page = Page(scenario, Suite())
    page.suite.frame = {"epuck1": np.array([-1.3, -0.7, 0.0]), "box": np.array([-1.15, -0.7, 0.0])}
    assert page.ready()
    state = JobState(system="single", robots=["epuck1"], object="box", state_name="IDLE")
    page.suite.states["/"].publish(state)
    browser.errors.clear()
    yield Watched(browser, page, scenario)
    assert browser.errors == []
    page.away(lambda: browser.open("about:blank"))
    page.close()


def test_a_goal_is_a_drag_and_nothing_else_is(shown):
    """Where it begins, facing where it goes; a click, a short drag, another button are none.

    Another button moves the map.
    """
    start = shown.pixel(0.9, -0.4)
    shown.mouse("mouseReleased", shown.drag(start, 0.0, 0.0))
    shown.mouse("mouseReleased", shown.drag(start, 20.0, 1.0))
    shown.mouse("mouseReleased", shown.drag(start, 80.0, 1.0, button="right"), "right")
    shown.mouse("mouseMoved", (start[0] + 1.0, start[1]))
    shown.until("!document.getElementById('cursor').textContent.startsWith('x 0.9')")
    shown.value("document.getElementById('whole').click()")
    shown.mouse("mouseMoved", shown.pixel(0.0, 0.0))
    shown.mouse("mouseMoved", start)
    shown.until("document.getElementById('cursor').textContent.startsWith('x 0.90')")
    end = shown.drag(start, 80.0, 1.0)
    shown.page.away(lambda: shown.browser.key("Escape"))
    shown.mouse("mouseReleased", end)
    assert shown.goals() == []
    shown.mouse("mouseReleased", shown.drag(start, 80.0, 2.0))
    assert shown.page.until(lambda: shown.page.suite.goals["/"])
    (goal,) = shown.goals()
    assert goal.pose.position.x == pytest.approx(0.9, abs=0.01)
    assert goal.pose.position.y == pytest.approx(-0.4, abs=0.01)
    angle = 2.0 * math.atan2(goal.pose.orientation.z, goal.pose.orientation.w)
    assert angle == pytest.approx(2.0, abs=0.02)


def test_nothing_lies_over_the_map(shown):
    """A goal can be set at the edge, too."""
    box = "document.getElementById('scene').getBoundingClientRect()"
    for u in (f"{box}.left + 20", f"{box}.right - 20"):
        for v in (f"{box}.top + 20", f"{box}.bottom - 20"):
            assert shown.value(f"document.elementFromPoint({u}, {v}).id") == "scene", (u, v)


@pytest.mark.parametrize("size", [(1200, 320), (390, 500)])
def test_the_tools_stay_in_sight(shown, size):
    """However far the page is scrolled, at a desk and on a phone."""
    try:
        shown.page.away(lambda: shown.browser.resize(*size))
        scroller = "(innerWidth > 800 ? document.querySelector('main') : document.scrollingElement)"
        shown.until(f"{scroller}.scrollHeight > {scroller}.clientHeight + 40")
        shown.value(f"{scroller}.scrollTop = 1e5")
        shown.until(f"{scroller}.scrollTop > 30")
        for name in ("pause", "reset", "theme"):
            middle = f"(b => [b.x + b.width / 2, b.y + b.height / 2])({_BOX.format(name)})"
            hit = f"(([x, y]) => document.elementFromPoint(x, y)?.id)({middle})"
            shown.until(f"{hit} === '{name}'", 3.0)
    finally:
        shown.page.away(lambda: shown.browser.resize(1200, 760))


def test_light_and_dark_are_remembered(shown):
    dark = "getComputedStyle(document.body).backgroundColor === 'rgb(20, 23, 28)'"
    before = shown.value(dark)
    shown.value("document.getElementById('theme').click()")
    assert shown.value(dark) is not before
    shown.page.away(lambda: shown.browser.open(f"http://127.0.0.1:{shown.page.server.port}/?again"))
    shown.until(f"document.readyState === 'complete' && ({dark}) === {str(not before).lower()}")
    shown.value("document.getElementById('theme').click()")
    assert shown.value(dark) is before
    shown.value("localStorage.clear()")


def test_the_page_tells_what_became_of_its_own_goal(shown):
    """A stranger's refusal is not its own."""
    shown.mouse("mouseReleased", shown.drag(shown.pixel(0.9, -0.4), 60.0, 0.0))
    assert shown.page.until(lambda: shown.page.suite.goals["/"])
    mine = shown.page.suite.goals["/"][0]
    state = JobState(system="single", robots=["epuck1"], object="box", refusals=1)
    state.refusal = "the goal of a stranger is in a wall"
    state.refused_goal.header.stamp.sec = mine.header.stamp.sec
    state.refused_goal.header.stamp.nanosec = (mine.header.stamp.nanosec + 1) % 1_000_000_000
    state.state_name = "FIRST"
    shown.page.suite.states["/"].publish(state)
    shown.until("document.getElementById('state').textContent === 'FIRST'")
    assert shown.text("answer") == "the goal is sent"
    state.refused_goal, state.refusals, state.refusal = mine, 2, "<i>too far</i>"
    shown.page.suite.states["/"].publish(state)
    shown.until("document.getElementById('answer').className === 'refused'")
    assert shown.text("answer") == "the goal was refused: <i>too far</i>"
    state.goal = mine
    state.refused_goal = type(mine)()
    shown.page.suite.states["/"].publish(state)
    shown.until("document.getElementById('answer').textContent === 'the goal is accepted'")


def test_a_page_whose_suite_is_gone_says_so_and_sends_nothing(shown):
    shown.page.suite.silent()
    shown.until("document.getElementById('trouble').textContent.includes('silent')")
    shown.mouse("mouseReleased", shown.drag(shown.pixel(0.9, -0.4), 80.0, 0.0))
    assert shown.goals() == []
    assert shown.value("document.getElementById('cancel').disabled")


def test_a_page_whose_viewer_is_gone_says_so_and_finds_it_again(shown):
    """Lost heartbeats of the stream: the server stands still but closes nothing."""
    shared = shown.page.server._shared
    port = shown.page.server.port
    shared.node = None  # what streams ask for every beat: they break off
    shown.page.server.close()
    shown.until(
        "document.getElementById('trouble').textContent.includes('does not respond any more')"
    )
    shown.mouse("mouseReleased", shown.drag(shown.pixel(0.9, -0.4), 80.0, 0.0))
    assert shown.goals() == []
    shown.page.server = PageServer(shown.page.node, "127.0.0.1", port)
    shown.until("document.getElementById('trouble').hidden", 12.0)


MODULES = "(async () => {const [d, m, s] = await Promise.all(['goal_drag', 'model', 'scene']"
MODULES += ".map(n => import(`/${n}.js`))); "


def test_the_logic_of_a_drag(shown):
    """Many random drags: long ones ask for their start and their angle, short ones for nothing."""
    random = np.random.default_rng(3)
    drags = [
        [*random.uniform(-1, 1, 2), *random.uniform(0, 800, 2), *random.uniform(-40, 40, 2)]
        for _ in range(300)
    ]
    found = shown.value(
        MODULES
        + f"""return {np.array(drags).tolist()}.map(([x, y, u, v, du, dv]) => {{
            let drag = d.begun({{x, y}}, {{x: u, y: v}});
            for (const t of [0.5, 2.0, 1.0])
              drag = d.moved(drag, {{x: x + t * du / 300, y: y - t * dv / 300}},
                             {{x: u + t * du, y: v + t * dv}});
            return d.released(drag); }})}})()"""
    )
    for (x, y, _, _, du, dv), goal in zip(drags, found, strict=True):
        if math.hypot(du, dv) < 24.0:
            assert goal is None
        else:
            assert goal == pytest.approx({"x": x, "y": y, "theta": math.atan2(-dv, du)})
    assert {g is None for g in found} == {True, False}


def test_the_range_of_a_chart_is_that_of_its_values(shown):
    ranges = shown.value(
        "(async () => { const {span} = await import('/charts.js');"
        "return [span(0, 0), span(null, null), span(0, 20), span(2, 2)]; })()"
    )
    (low, high), nothing, (least, most), (below, above) = ranges
    assert low < 0.0 < high < 1.0
    assert nothing == [0, 1]
    assert least <= 0.0 and 20.0 <= most <= 30.0
    assert below < 2.0 < above


def test_errors_of_the_object_and_of_a_method_are_two_lines(shown):
    """Figures of a report that are called like the object's own error; and a goal that is taken and
    then cannot be worked on."""
    names, kind, text = shown.value(
        MODULES
        + """
        const model = m.emptyModel(), team = {space: "/", state: "PUSHING", job: 1, object: "box",
          step: [0, 0], stamp: "7", code: 0, goal: [0, 0, 0], refusals: 0, reason: "on"};
        m.take(model, "team", team, 0); model.time = 1.0;
        const rows = [{name: "method", text: "group"}, {name: "phase", text: "push"},
          {name: "position error", text: "", value: 0.001, unit: "m"},
          {name: "speed", text: "", value: 0.1, unit: "m/s"}];
        m.take(model, "panel", {space: "/", rows, shapes: []}, 0);
        m.take(model, "team", {...team, state: "IDLE", code: 301, reason: "leave it unset"}, 0);
        const {kind, text} = m.answerTo({space: "/", stamp: "7"}, model.teams.get("/"));
        return [[...model.teams.get("/").series.keys()], kind, text]; })()"""
    )
    assert names == ["position error (group)", "speed"]
    assert (kind, text) == ("refused", "leave it unset")


def test_a_chart_of_one_moment_is_drawn(shown):
    """All charts have one time axis, which has no width yet when the first value comes."""
    drawn = shown.value(
        """(async () => {
        const {Charts} = await import('/charts.js'), host = document.createElement('div');
        document.body.append(host);
        const charts = new Charts(host, () => {}), line = t => [["", new Map([["a",
          {unit: "m", limit: undefined, t, v: t.map(() => 1)}]])]];
        for (const t of [[5], [5, 6], []]) charts.show(line(t), [], null);
        await new Promise(requestAnimationFrame);
        const count = host.querySelectorAll("canvas").length;
        host.remove(); return count; })()"""
    )
    assert drawn == 1 and shown.browser.errors == []


def test_times_of_a_lab_are_times_of_day(shown):
    seconds, hours, tick, small = shown.value(
        MODULES
        + """
        const t = new Date(2026, 10, 24, 9, 5, 3, 250).getTime() / 1e3;
        return [m.timeText(12.345), m.timeText(t), m.tickText(t), m.tickText(0.0005)]; })()"""
    )
    assert (seconds, hours, tick, small) == ("12.3 s", "09:05:03.3", "09:05:03", "0.0005")


def test_what_counts_as_silence(shown):
    """The page's own judgement, with a clock passed in."""
    assert shown.value(
        MODULES + """
        const model = m.emptyModel(), at = (t, space = "/") => m.trouble(model, space, t);
        const seen = [at(0)];
        m.take(model, "suite", {trouble: "", paused: false, teams: {"/": "", "/a/": "deaf"}}, 1000);
        seen.push(at(1001), at(1799), at(1801), at(1001, "/a/"), at(1001, "/b/"), at(1001, ""));
        m.take(model, "suite", {trouble: "silent", paused: false, teams: {"/": "silent"}}, 2000);
        seen.push(at(2001));
        return seen.map(text => text.split(":")[0]); })()"""
    ) == [
        "connecting to the viewer", "", "", "the viewer does not respond any more", "deaf",
        "no node accepts goals yet", "no node accepts goals yet", "silent",
    ]  # fmt: skip


def test_a_thousand_bodies_are_drawn(ros, scenario, browser, tmp_path):
    """And drawn again and again while events come."""
    page = Page(crowd(scenario, 1000), Suite())
    try:
        random = np.random.default_rng(1)
        poses = random.uniform((-1.4, -0.9, -3.0), (1.4, 0.9, 3.0), (1001, 3))
        names = [f"r{i}" for i in range(1000)] + ["box"]
        page.suite.frame = dict(zip(names, poses, strict=True))
        assert page.ready()
        page.away(lambda: browser.open(f"http://127.0.0.1:{page.server.port}/"))
        count = """new Promise(done => { let drawn = 0; const begun = performance.now();
            const pen = CanvasRenderingContext2D.prototype, clear = pen.clearRect;
            pen.clearRect = function (...a) {
                if (++drawn === 20) { pen.clearRect = clear; done(performance.now() - begun); }
                return clear.apply(this, a); }; })"""
        watched = Watched.__new__(Watched)
        watched.browser, watched.page, watched.scenario = browser, page, scenario
        watched.until("document.getElementById('numbers').textContent.includes('1000, 1')", 60.0)
        took = watched.value(count)
        print(f"{20e3 / took:.1f} pictures a second")  # depends on the machine
        assert browser.errors == []
    finally:
        page.away(lambda: browser.open("about:blank"))
        page.close()


def crowd(scenario, count):
    """A scenario with so many robots."""
    from dataclasses import replace

    spec = scenario.robot()[1]
    robots = {f"r{i}": (spec, np.zeros(3)) for i in range(count)}
    return replace(scenario, robots=robots)
