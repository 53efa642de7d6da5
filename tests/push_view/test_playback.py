"""Bags on the page: what is sent, and what a browser shows of it."""

import json
import socket
import time

import numpy as np
import pytest

from planar_push.main import main
from push_msgs.msg import GroupPlan, JobState, Report
from push_record.bag import bag_file
from push_view.http_answers import page_address
from push_view.playback import _one, playback_json
from push_view.playback_server import PlaybackServer
from tests.push_view.browser import CHROMIUM, Browser
from tests.push_view.test_report import Bag, crowd


def written(scenario, folder, speed=0.1, begin=5.0):
    """Ten seconds of a robot and a box that go along x, with a job from the second second on."""
    bag = Bag(folder, crowd(scenario, 1, 1))
    for i in range(501):
        t = begin + 0.02 * i
        bag.poses(
            {
                "r0": np.array([speed * 0.02 * i, 0, 0]),
                "box0": np.array([0.1, speed * 0.02 * i, 0]),
            },
            t,
        )
        if i in (100, 400):
            state = JobState(system="group", robots=["r0"], object="box0", job=1)
            state.state_name, state.reason = ("PUSHING", "on") if i == 100 else ("IDLE", "reached")
            state.header.stamp.sec, state.header.stamp.nanosec = int(t), round(1e9 * (t % 1.0))
            state.goal.header.frame_id = "map"
            state.goal.pose.position.x, state.goal.pose.position.y = 0.1, speed * 10.0
            state.goal.pose.orientation.w = 1.0
            bag.write("/job_state", state, t)
        if i in (150, 250):  # two pieces of one way
            plan = GroupPlan(object="box0", pushers=["r0"], x=[0.1, 0.1], y=[0.0, i / 100.0])
            for name in ("way", "contact_x", "contact_y", "normal_x", "normal_y", "force"):
                setattr(plan, name, [1.0])
            for name in ("time", "theta", "vx", "vy", "omega"):
                setattr(plan, name, [0.0, 1.0])
            bag.write("/group_plan", plan, t)
    return bag.close()


def test_what_is_sent_of_a_bag(scenario, tmp_path):
    data = json.loads(json.dumps(playback_json(written(scenario, tmp_path / "a")), allow_nan=False))
    assert data["name"] == "a" and data["bodies"]["names"] == ["r0", "box0"]
    x, y, _ = data["poses"][1]
    assert len(x) == len(data["t"]) == 501 and (x[0], y[0], y[-1]) == (1000, 0, 10000)
    (team,) = data["teams"]
    assert [(s["t"], s["state"]) for s in team["states"]] == [(7.0, "PUSHING"), (13.0, "IDLE")]
    assert [len(p["pushes"]) for p in team["plans"]] == [1, 2]
    assert [p["t"] for p in team["plans"]] == pytest.approx([8.0, 10.0], abs=0.021)
    error = team["series"]["position error"]
    assert error["t"][0] == 7.0 and error["v"][0] == pytest.approx(0.8, abs=1e-3)
    assert error["v"][-1] == pytest.approx(0.0, abs=1e-6) and error["unit"] == "m"
    hall = crowd(scenario, 1, 1).environment
    assert data["bodies"]["obstacles"]["size"] == list(hall.size)


def test_a_long_bag_of_many_bodies_is_thinned(scenario, tmp_path, monkeypatch):
    monkeypatch.setattr("push_view.playback.VALUES", 600)
    data = playback_json(written(scenario, tmp_path / "a"))
    assert len(data["t"]) == 100 and data["t"][0] == 5.0 and data["t"][-1] == 15.0


def test_a_long_series_keeps_its_peaks():
    values = np.zeros(20_000)
    peaks = np.array([17, 4_321, 9_999, 19_998])
    values[peaks] = [3.0, -2.0, 1.0, 5.0]
    sent = _one("m", np.arange(20_000.0), values, 2.5)
    assert len(sent["t"]) <= 3_000 and sent["limit"] == 2.5
    kept = dict(zip(sent["t"], sent["v"], strict=True))
    assert [kept.get(float(p)) for p in peaks] == [3.0, -2.0, 1.0, 5.0]
    assert "limit" not in _one("m", np.arange(3.0), np.ones(3))


@pytest.mark.long
def test_extreme_numbers_in_a_bag_are_left_out_or_kept(scenario, tmp_path):
    """What somebody recorded is a valid message, and need not be valid JSON."""
    bag = Bag(tmp_path / "bag", crowd(scenario, 1, 1))
    for i in range(11):
        bag.poses({"r0": np.zeros(3), "box0": np.zeros(3)}, 1.0 + 0.1 * i)
    bag.write("/job_state", JobState(system="single", robots=["r0"], object="box0"), 1.0)
    figure = {"figures": ["f"], "units": ["m"], "values": [1.79769e308], "limits": [1.79769e308]}
    shape = {"kinds": [0], "layers": ["l"], "counts": [1], "x": [0.0], "y": [0.0]}
    for k, given in enumerate(
        (
            {"solve_time": np.inf, "radii": [0.1]},
            {"solve_time": 1.79769e308, "radii": [0.1]},
            {"radii": [np.nan]},
        )
    ):
        message = Report(method="m", phase="push", **figure, **shape, **given)
        message.header.stamp.sec = 1 + k
        bag.write("/report", message, 1.5 + 0.1 * k)
    path = bag.close()
    data = json.loads(json.dumps(playback_json(path), allow_nan=False))
    (team,) = data["teams"]
    assert team["series"]["f"]["v"] == [1.79769e308] * 2 and len(team["moments"][0]) == 2
    assert main(["report", str(path), "--out", str(tmp_path / "out")]) == 0


def test_wrong_arguments_are_told(scenario, tmp_path, capsys):
    bag = str(written(scenario, tmp_path / "a"))
    for words, expected in (
        (["play", bag, bag, "--publish"], "--publish plays one bag"),
        (["play", bag, "--factor", "2"], "--factor and --namespace belong to --publish"),
        (["play", bag, "--publish", "--port", "9"], "--host and --port belong to the page"),
        (["play", bag, "--publish", "--host", "1.2.3.4"], "--host and --port belong to the page"),
        (["play", bag, "--host", "no.such.host.invalid"], "--host no.such.host.invalid: "),
        (["play", bag, "--host", "192.0.2.1", "--port", "0"], "--host 192.0.2.1: "),
        (["play", bag, "--host", "a..b"], "--host a..b: "),
    ):
        assert main(words) == 2
        told = capsys.readouterr().err
        assert expected in told and "port 8080" not in told


def test_a_port_that_is_taken_is_told(scenario, tmp_path, capsys):
    bag = str(written(scenario, tmp_path / "a"))
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["play", bag, "--port", str(port)]) == 2
        assert main(["view", "--port", str(port)]) == 2
    told = capsys.readouterr().err
    assert told.count(f"port {port}: ") == 2 and told.count("try --port 0") == 2


def test_view_names_a_host_that_is_none(capsys, domain):
    assert main(["view", "--host", "no.such.host.invalid"]) == 2
    told = capsys.readouterr().err
    assert "--host no.such.host.invalid: " in told and "port 8080" not in told


def test_addresses_can_be_opened():
    assert page_address("127.0.0.1", 8080) == "http://127.0.0.1:8080/"
    assert page_address("::1", 8080) == "http://[::1]:8080/"
    for everywhere in ("0.0.0.0", "::", ""):
        assert page_address(everywhere, 80) == f"http://{socket.gethostname()}:80/"


def test_play_says_where_a_bag_is_cut_off(scenario, tmp_path, capsys, monkeypatch):
    bag = written(scenario, tmp_path / "bag")
    assert playback_json(bag)["trouble"] == ""
    file = bag_file(bag)
    file.write_bytes(file.read_bytes()[:-2000])
    assert playback_json(bag)["trouble"] == "cut off"
    monkeypatch.setattr("planar_push.arguments.stop_on_signals", lambda stop: stop())
    assert main(["play", str(bag), "--port", "0"]) == 0
    told = capsys.readouterr().out
    assert f"{bag}: the file is cut off at 15.00 s" in told and "http://127.0.0.1:" in told


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_two_bags_side_by_side_in_a_browser(scenario, tmp_path):
    """Of two lengths of way, with stamps that begin at different times."""
    bags = [written(scenario, tmp_path / "slow"), written(scenario, tmp_path / "fast", 0.2, 100.0)]
    server = PlaybackServer(bags, "127.0.0.1", 0)
    browser = Browser(tmp_path / "profile")
    try:
        browser.open(f"http://127.0.0.1:{server.port}/")
        wait(browser, "document.getElementById('slider')")
        assert browser.value("document.querySelectorAll('canvas[id^=scene]').length") == 2
        assert browser.value("Number(document.getElementById('slider').max)") == pytest.approx(10.0)
        legend = "[...document.querySelectorAll('.chart')][0].textContent"
        assert all(name in browser.value(legend) for name in ("slow", "fast"))
        shown = "document.getElementById('numbers').textContent"
        took = []
        for t in (9.5, 0.5, 4.0):
            took.append(browser.value(seek(t)))
            text = browser.value(shown)
            assert f"time{t:.1f} s" in text
        print(f"seeks: {max(took):.0f} ms at most")  # depends on the machine
        assert "600.0 mm" in browser.value(shown)  # 0.4 m of 1 m are done
        assert browser.value("document.querySelectorAll('#log button').length") == 1
        browser.value("document.getElementById('team').value = 1")
        browser.value("document.getElementById('team').dispatchEvent(new Event('change'))")
        wait(browser, f"{shown}.includes('1200.0 mm')")
        browser.value("document.querySelector('#log button').click()")  # to the begin of the job
        wait(browser, "document.getElementById('now').textContent.startsWith('2.00')")
        browser.value("document.getElementById('on').click()")
        wait(browser, "document.getElementById('now').textContent.startsWith('2.02')")
        browser.value("document.getElementById('go').click()")
        wait(browser, "parseFloat(document.getElementById('now').textContent) > 2.5")
        browser.key(" ")  # pause
        wait(browser, "document.getElementById('go').textContent === '▶'")
        time_shown = "parseFloat(document.getElementById('now').textContent)"
        browser.value(seek(4.0))
        for key, expected in (("ArrowRight", 4.02), ("ArrowRight", 4.04), ("ArrowLeft", 4.02)):
            browser.key(key)
            wait(browser, f"{time_shown} === {expected}")
        assert browser.errors == []
    finally:
        browser.close()
        server.close()


def wait(browser, expression):
    end = time.monotonic() + 10.0
    while not browser.value(f"Boolean({expression})"):
        assert time.monotonic() < end, browser.value("document.body.innerText")
        time.sleep(0.05)


def seek(t):
    """Move the slider; answers [ms] until the picture has been drawn."""
    return f"""new Promise(done => {{
      const begun = performance.now(), s = document.getElementById('slider');
      s.value = {t}; s.dispatchEvent(new Event('input'));
      const drawn = () => done(performance.now() - begun);
      requestAnimationFrame(() => requestAnimationFrame(drawn)); }})"""
