"""The live view: what pages are told, and what they may ask for."""

import json
import math

import numpy as np
import pytest
from nav_msgs.msg import Path
from std_msgs.msg import Bool, String

from push_job.report import Figure, polyline
from push_job.report import Report as Report_
from push_msgs.msg import Belief, JobState, Report
from push_msgs.srv import Displace, Kill
from push_ros.conversions import grid_to_ros, path_to_ros, pose_stamped_to_ros
from push_ros.process import Spinner
from push_ros.qos import BELIEF, LATCHED, STATUS
from push_ros.report_conversions import report_to_ros
from push_view.suite_watch import SILENCE
from tests.push_view.page_client import Page, Suite

GOAL = {"x": 1.0, "y": 0.5, "theta": 0.3}


@pytest.fixture
def page(ros, scenario):
    page = Page(scenario, Suite())
    assert page.ready()
    yield page
    page.close()


@pytest.fixture
def teams(ros, scenario):
    page = Page(scenario, Suite(("/left/", "/right/")))
    assert page.ready()
    yield page
    page.close()


def test_page_and_map(page, scenario):
    status, kind, body = page.ask("GET", "/")
    assert status == 200 and kind.startswith("text/html") and b"<canvas" in body
    for name in ("page.js", "model.js", "scene.js", "side.js", "goal_drag.js"):
        status, kind, body = page.ask("GET", f"/{name}")
        assert status == 200 and kind.startswith("text/javascript") and len(body) > 100
    assert page.ask("GET", "/map.png")[0] == 404
    page.suite.maps.publish(grid_to_ros(scenario.grid, 1.0))
    assert page.until(lambda: page.node.map_image() is not None)
    status, kind, body = page.ask("GET", "/map.png")
    assert (status, kind) == (200, "image/png") and body.startswith(b"\x89PNG")
    extent = page.events(lambda seen: "map" in seen)["map"]["extent"]
    assert extent == pytest.approx(scenario.grid.extent)
    for path in ("/elsewhere", "/../page_server.py", "/page/index.html"):
        assert page.ask("GET", path)[0] == 404


def test_bodies_are_learnt_from_the_topic_and_replaced_by_a_new_scenario(ros, scenario):
    page = Page(None, Suite())
    try:
        page.suite.scenarios.publish(String(data=scenario.text))
        page.suite.frame = {"box": np.array([0.5, -0.2, 1.0])}
        seen = page.events(lambda s: s.get("poses", {}).get("x", [None, None])[1] is not None)
        bodies = seen["bodies"]
        assert bodies["names"] == ["epuck1", "box"]
        outlines = [np.array(t["outline"]) for t in bodies["types"]]
        assert [t["robot"] for t in bodies["types"]] == [True, False]
        assert np.ptp(outlines[1], axis=0) == pytest.approx([0.09, 0.09])
        assert seen["poses"]["x"] == [None, 5000] and seen["poses"]["a"] == [None, 1000]
        page.suite.scenarios.publish(String(data="robots: {"))  # refused; the one before stays
        page.suite.scenarios.publish(String(data=scenario.text.replace("epuck1", "other")))
        page.suite.frame = {"epuck1": np.zeros(3), "other": np.array([0.1, 0.0, 0.0])}
        seen = page.events(
            lambda s: (
                s.get("bodies", {}).get("names") == ["other", "box"]
                and s.get("poses", {}).get("x", [None])[0] == 1000
            )
        )
        assert seen["poses"]["revision"] == seen["bodies"]["revision"] == bodies["revision"] + 1
    finally:
        page.close()


def test_events_carry_poses_and_states_and_nothing_that_is_not_json(page):
    page.suite.frame = {
        "box": np.array([0.5, -0.2, 1.0]),
        "epuck1": np.array([0.4, math.nan, 1.0]),
        "stranger": np.array([0.4, 0.0, 1.0]),
    }
    state = JobState(system="single", robots=["epuck1"], object="box", progress=math.nan)
    state.state_name, state.reason = "PLANNING", "why <b>not</b>\n\nevent: team"
    page.suite.states["/"].publish(state)
    seen = page.events(
        lambda s: ("team", "/") in s and s.get("poses", {}).get("x", [0])[-1] is not None
    )
    poses = seen["poses"]
    assert (poses["x"], poses["y"], poses["a"]) == ([None, 5000], [None, -2000], [None, 1000])
    assert poses["lost"] == [0]
    team = seen["team", "/"]
    assert (team["state"], team["reason"]) == ("PLANNING", state.reason)
    assert seen["members", "/"]["robots"] == ["epuck1"]
    assert seen["log", "/"]["entries"] == [[0.0, "PLANNING", state.reason]]


def test_a_run_that_begins_anew_has_a_log_and_figures_of_its_own(page):
    """Time goes back, as after a reset of the world or a restart of the suite."""
    reports = page.suite.node.create_publisher(Report, "/report", STATUS)

    def told(second, name):
        state = JobState(system="swarm", robots=["epuck1"], object="box", state_name=name)
        state.header.stamp.sec = second
        page.suite.states["/"].publish(state)

    def log(enough):
        seen = page.events(lambda s: enough(s.get(("log", "/"), {}).get("entries", [])))
        return [(t, name) for t, name, _ in seen["log", "/"]["entries"]], seen

    told(0, "IDLE")
    log(lambda entries: len(entries) == 1)
    told(14, "PUSHING")
    log(lambda entries: len(entries) == 2)
    assert page.until(lambda: reports.get_subscription_count() > 0)
    made = Report_("push", (Figure("to the target", 0.4, "m"),))
    reports.publish(report_to_ros(made, JobState().header.stamp, "swarm", "box"))
    rows = page.events(lambda s: len(s.get(("panel", "/"), {}).get("rows", [])) > 1)
    assert any(r["name"] == "to the target" for r in rows["panel", "/"]["rows"])
    told(1, "IDLE")
    entries, _ = log(lambda entries: len(entries) == 1)
    assert entries == [(1.0, "IDLE")]
    page.events(lambda s: s.get(("panel", "/"), {}).get("rows") == [])


def test_the_panel_of_a_single_robot_and_the_plan(page):
    page.suite.states["/"].publish(JobState(system="single", robots=["epuck1"], object="box"))
    reports = page.suite.node.create_publisher(Report, "/epuck1/report", STATUS)
    paths = page.suite.node.create_publisher(Path, "/push_path", LATCHED)
    assert page.until(lambda: reports.get_subscription_count() > 0)
    way = polyline("way", np.array([[0.0, 0.0], [0.1, 0.2]]))
    figures = (Figure("error", 5e-3, "m"), Figure("speed", 0.07, "m/s"), Figure("margin", math.inf))
    report = Report_("push", figures, (way,))
    reports.publish(report_to_ros(report, JobState().header.stamp, "ltv", "box"))
    message = path_to_ros([], 0.0)
    message.poses = [pose_stamped_to_ros(np.array([0.1, i / 1e3, 0.0]), 0.0) for i in range(999)]
    paths.publish(message)
    seen = page.events(lambda s: ("plan", "/") in s and s.get(("panel", "/"), {}).get("rows"))
    rows = {r["name"]: r["text"] for r in seen["panel", "/"]["rows"]}
    assert rows["error"] == "5.0 mm" and rows["speed"] == "0.07 m/s"
    assert rows["margin"] == "–" and rows["phase"] == "push" and rows["method"] == "ltv"
    (shape,) = seen["panel", "/"]["shapes"]
    assert shape["layer"] == "way" and shape["points"] == [[0, 0], [100, 200]]
    (push,) = seen["plan", "/"]["pushes"]
    assert len(push["points"]) == 400 and push["points"][-1] == [0.1, 0.998]


def test_a_goal_and_a_cancel_of_the_page_reach_ros(page):
    status, data = page.send(**GOAL)
    assert status == 202
    assert page.until(lambda: page.suite.goals["/"])
    goal = page.suite.goals["/"][0]
    assert goal.header.frame_id == "map"
    assert (goal.pose.position.x, goal.pose.position.y) == (1.0, 0.5)
    assert json.loads(data)["stamp"] == f"{goal.header.stamp.sec}.{goal.header.stamp.nanosec:09d}"
    assert page.ask("POST", "/cancel", "{}")[0] == 202
    assert page.until(lambda: page.suite.cancels["/"] == 1)


def test_the_bodies_of_a_world_are_moved_and_killed_by_its_services(page):
    """The page's requests reach the services of the bridge, and their answers come back."""
    calls = []

    def answer(request, response):
        calls.append(request)
        response.success, response.message = len(calls) < 3, "there is a wall"
        return response

    node = page.suite.node
    assert page.ask("POST", "/kill", '{"robot": "epuck1"}')[0] == 409, "nobody answers yet"
    node.create_service(Kill, "/bridge/kill", answer)
    node.create_service(Displace, "/displace", answer)
    assert page.until(lambda: {"kill", "displace"} <= set(page.node.suite()["offered"]))
    assert page.ask("POST", "/kill", '{"robot": "epuck1"}')[0] == 202
    place = '{"name": "box", "x": 0.5, "y": -0.25, "theta": 1.0}'
    assert page.ask("POST", "/displace", place)[0] == 202
    status, _, text = page.ask("POST", "/displace", place)
    assert status == 409 and b"there is a wall" in text
    assert calls[0].robot == "epuck1"
    assert (calls[1].name, calls[1].x, calls[1].y, calls[1].theta) == ("box", 0.5, -0.25, 1.0)
    for path, body in (
        ("/kill", '{"robot": 3}'),
        ("/displace", '{"name": "box", "x": 0.5, "y": "", "theta": 1}'),
        ("/pause", '{"paused": 1}'),
    ):
        assert page.ask("POST", path, body)[0] == 400
    assert page.ask("POST", "/start", '{"system": "single", "scenario": "short"}')[0] == 409
    assert len(calls) == 3


def offering(page):
    """A page whose world moves and kills bodies; the requests that reach it."""
    calls = []

    def answer(request, response):
        calls.append(request)
        response.success = True
        return response

    page.suite.node.create_service(Kill, "/bridge/kill", answer)
    page.suite.node.create_service(Displace, "/displace", answer)
    assert page.until(lambda: {"kill", "displace"} <= set(page.node.suite()["offered"]))
    return calls


@pytest.mark.parametrize("name", [r"\ud800", r"box\udcff", "x" * 5000])
def test_a_name_that_no_message_can_hold_is_refused(page, name):
    """JSON may hold half of a character, which is no text elsewhere."""
    calls = offering(page)
    for path, body in (
        ("/kill", f'{{"robot": "{name}"}}'),
        ("/displace", f'{{"name": "{name}", "x": 0.5, "y": 0.0, "theta": 1.0}}'),
        ("/start", f'{{"system": "{name}", "scenario": "short"}}'),
        ("/cancel", f'{{"space": "{name}"}}'),
        ("/goal", json.dumps(GOAL)[:-1] + f', "space": "{name}"}}'),
    ):
        status, _, text = page.ask("POST", path, body)
        assert status == 400 and b"expected text" in text and len(text) < 300
    assert page.ask("GET", "/suite")[0] == 200 and calls == []


def test_a_request_that_cannot_be_sent_is_answered(page, monkeypatch):
    """Whatever it is, the viewer goes on."""
    offering(page)

    def fails(*_):
        raise RuntimeError("the client is broken")

    monkeypatch.setattr(page.node._controls, "ask", fails)
    status, _, text = page.ask("POST", "/kill", '{"robot": "epuck1"}')
    assert status == 409 and b"the client is broken" in text
    monkeypatch.setattr(page.node._teams["/"], "send", fails)
    assert page.send(**GOAL)[0] == 202
    assert page.ask("GET", "/suite")[0] == 200


def test_what_is_believed_is_listed_with_intervals_and_sources(page):
    beliefs = page.suite.node.create_publisher(Belief, "/belief", BELIEF)
    assert page.until(lambda: beliefs.get_subscription_count() > 0)
    message = Belief(
        source="person", bodies=["box", ""], quantities=["contact_friction", "latency"]
    )
    message.values, message.lows, message.highs = [0.25, 0.03], [0.2, 0.02], [0.3, 0.04]
    beliefs.publish(message)
    seen = page.events(lambda s: any(r["source"] == "person" for r in s["belief"]["rows"])
                       if "belief" in s else False)  # fmt: skip
    rows = {(r["body"], r["quantity"]): r for r in seen["belief"]["rows"]}
    friction = rows["box", "contact_friction"]
    assert (friction["value"], friction["low"], friction["high"]) == (0.25, 0.2, 0.3)
    assert rows["poses", "latency"]["value"] == 0.03 and rows["box", "mass"]["source"] == "scenario"
    message.values = [float("nan"), 0.03]
    beliefs.publish(message)
    page.until(lambda: False, 0.3)
    again = page.events(lambda s: "belief" in s)["belief"]["rows"]
    assert again == seen["belief"]["rows"], "a belief that cannot be is refused"


EXTREME = {
    "radius": {"kinds": [0], "layers": ["l"], "counts": [1], "radii": [math.nan], "x": [0.0]}
    | {"y": [0.0]},
    "solve time": {"solve_time": math.inf},
    "long solve": {"solve_time": 1.79769e308},
    "figure": {"figures": ["f"], "units": ["m"], "values": [1.79769e308], "limits": [1.79769e308]},
}
"""Fields of valid reports with numbers that JSON does not know, or that rounding makes infinite."""


@pytest.mark.parametrize("name", EXTREME)
def test_a_report_with_extreme_numbers_is_shown_or_refused(page, name):
    page.suite.states["/"].publish(JobState(system="single", robots=["epuck1"], object="box"))
    reports = page.suite.node.create_publisher(Report, "/report", STATUS)
    assert page.until(lambda: reports.get_subscription_count() > 0)
    for message in (
        Report(method="extreme", phase="push", **EXTREME[name]),
        Report(method="plain", phase="push"),
    ):
        reports.publish(message)
        page.until(lambda: False, 0.6)
    seen = page.events(
        lambda s: any(r["text"] == "plain" for r in s.get(("panel", "/"), {}).get("rows", []))
    )
    assert seen["panel", "/"]["shapes"] == []


@pytest.mark.parametrize(
    "text",
    ["environment: 2001-99-99", "environment: &a [*a]\nrobots: *a", "a: " + "[" * 20000],
)
def test_a_scenario_that_is_none_is_refused(page, text):
    before = page.events(lambda s: "bodies" in s)["bodies"]
    page.suite.scenarios.publish(String(data=text))
    page.until(lambda: False, 0.5)
    assert page.events(lambda s: "bodies" in s)["bodies"] == before


def test_a_belief_of_extreme_size_is_listed(page):
    beliefs = page.suite.node.create_publisher(Belief, "/belief", BELIEF)
    assert page.until(lambda: beliefs.get_subscription_count() > 0)
    huge = 1.79769e308
    message = Belief(source="person", bodies=["box"], quantities=["mass"])
    message.values, message.lows, message.highs = [huge], [0.1], [huge]
    beliefs.publish(message)
    page.until(lambda: False, 0.5)
    assert page.events(lambda s: "belief" in s)["belief"]["rows"]


def test_each_team_has_its_state_and_gets_its_own_goals(teams):
    for space, robot in (("/left/", "epuck1"), ("/right/", "other")):
        state = JobState(system="single", robots=[robot], object="box", state_name=robot.upper())
        teams.suite.states[space].publish(state)
    seen = teams.events(lambda s: ("team", "/left/") in s and ("team", "/right/") in s)
    assert seen["teams"]["spaces"] == ["/left/", "/right/"]
    assert seen["team", "/right/"]["state"] == "OTHER"
    assert teams.send(space="/right/", **GOAL)[0] == 202
    assert teams.until(lambda: teams.suite.goals["/right/"])
    assert teams.suite.goals["/left/"] == []
    assert teams.ask("POST", "/cancel", '{"space": "/left/"}')[0] == 202
    assert teams.until(lambda: teams.suite.cancels["/left/"])
    assert teams.suite.cancels["/right/"] == 0
    status, data = teams.send(space="/middle/", **GOAL)
    assert status == 409 and b"/middle/" in data


def test_a_goal_is_known_again_by_its_stamp(page):
    """Of two equal goals each is told what became of it: one is taken, one refused."""
    stamps = [json.loads(page.send(**GOAL)[1])["stamp"] for _ in range(2)]
    assert len(set(stamps)) == 2
    assert page.until(lambda: len(page.suite.goals["/"]) == 2)
    taken, refused = page.suite.goals["/"]
    state = JobState(goal=taken, refused_goal=refused, refusals=1, refusal="it is in a wall")
    page.suite.states["/"].publish(state)
    team = page.events(lambda s: s.get(("team", "/"), {}).get("refusals"))["team", "/"]
    assert [team["stamp"], team["refused_stamp"]] == stamps
    assert team["refusal"] == "it is in a wall"


@pytest.mark.parametrize(
    "body",
    ["", "{", "[]", "3", '{"x": 1}', '{"x": "a", "y": 0, "theta": 0}']
    + ['{"x": NaN, "y": 0, "theta": 0}', '{"x": 1, "y": 0, "theta": 0, "space": 3}']
    + ['{"x": 1e400, "y": 0, "theta": 0}', "[" * 9000],
)
def test_a_goal_that_is_none_is_refused(page, body):
    status, _, text = page.ask("POST", "/goal", body)
    assert status == 400 and b"expected" in text
    assert page.suite.goals["/"] == []


def test_no_goal_is_taken_where_there_is_no_suite(ros, scenario):
    page = Page(scenario)
    try:
        assert page.until(lambda: "nobody publishes /poses" in page.node.suite()["trouble"])
        assert "Start a suite" in page.node.suite()["trouble"]
        status, data = page.send(**GOAL)
        assert status == 409 and b"nobody publishes /poses" in data
        assert page.ask("POST", "/cancel", "{}")[0] == 409
    finally:
        page.close()


def test_a_suite_that_falls_silent_takes_no_goal(page):
    """Nothing of it leaves the graph, as when its machine is gone: the silence tells."""
    page.suite.silent()
    assert SILENCE < 0.8
    assert page.until(lambda: "silent" in page.node.suite()["trouble"])
    seen = page.events(lambda s: "silent" in s.get("suite", {}).get("trouble", ""))
    assert "silent" in seen["suite"]["teams"]["/"]
    status, data = page.send(**GOAL)
    assert status == 409 and b"silent" in data
    page.until(lambda: bool(page.suite.goals["/"]), 0.3)
    assert page.suite.goals["/"] == []


def test_a_pause_is_no_silence(page):
    page.suite.paused.publish(Bool(data=True))
    page.suite.silent()
    assert page.until(lambda: page.node.suite()["paused"])
    assert not page.until(lambda: page.node.suite()["trouble"] != "", 2.0 * SILENCE)
    assert page.send(**GOAL)[0] == 202


def test_a_team_that_leaves_the_graph_takes_no_goal(teams):
    """The poses go on: the graph tells. The other team is not touched."""
    teams.suite.node.destroy_publisher(teams.suite.states["/left/"])
    assert teams.until(lambda: teams.node.suite()["teams"]["/left/"] != "")
    status, data = teams.send(space="/left/", **GOAL)
    assert status == 409 and b"no node accepts goals on /left/goal_pose" in data
    assert teams.send(space="/right/", **GOAL)[0] == 202


def test_a_viewer_that_hangs_takes_no_goal(page):
    """Its threads still answer, but nothing of what they know is new."""
    page.spinner.close()
    page.spinner = Spinner([])
    assert page.until(lambda: "hangs" in page.node.suite()["trouble"], 3.0)
    assert page.send(**GOAL)[0] == 409
