"""Reports in HTML: one file without a network, in a browser where there is one."""

import json
import re

import numpy as np
import pytest

from planar_push.main import main
from push_msgs.msg import ControllerStatus, JobState
from push_record.bag import bag_file
from push_record.contents import load
from push_record.faults import faults_of
from push_view.html_report import timings
from push_view.report import write_report
from push_view.study_report import grouping, measures, write_study_report
from tests.push_view.browser import CHROMIUM, Browser
from tests.push_view.test_playback import wait
from tests.push_view.test_report import Bag, crowd


def written(scenario, folder, unfinished=False):
    """A robot that pushes a box 0.9 m in ten seconds, with a refusal, a touch and a fallback."""
    bag = Bag(folder / "bag", crowd(scenario, 2, 1))
    goal = [0.99, 0.0, 0.0]
    for i in range(501):
        t = 0.02 * i
        x = 0.0018 * i
        poses = {"r0": [x, 0.0, 0.0], "r1": [0.0, 0.8, 0.1], "box0": [x + 0.09, 0.0, 0.0]}
        bag.poses({n: np.array(p) for n, p in poses.items()}, t)
        if i % 5 == 0:
            values = {"solve_time": 1e-4 * (1 + i / 500), "obstacle_margin": 0.3 - 0.0002 * i}
            bag.status("r0", t, error_x=0.001, **values)
        if i == 300:
            message = ControllerStatus(mode=ControllerStatus.FALLBACK, robot="r0", reason="late")
            bag.write("/r0/controller/status", message, t)
        if i == 100:
            bag.state("/", "PUSHING", t, ["r0"], "box0", goal)
        if i == 200:
            bag.touch([("r0", "r1")], t)
            message = JobState(system="single", robots=["r0"], object="box0", state_name="PUSHING")
            message.refusals, message.refusal_code, message.refusal = 1, 3, "in a </script> wall"
            bag.write("/job_state", message, t)
    if not unfinished:
        bag.state("/", "IDLE", 10.0, ["r0"], "box0", goal)
    return bag.close()


def test_faults_and_timing_of_a_bag(scenario, tmp_path):
    bag = written(scenario, tmp_path)
    contents = load(bag)
    assert [(f.kind, f.where) for f in faults_of(bag, contents)] == [
        ("collision", "r0, r1"),
        ("refusal", "/job_state"),
        ("fallback", "/r0/controller/status"),
    ]
    (solve,) = [row for row in timings(contents) if "r0" in row[0]]
    assert solve[2] == pytest.approx(0.15, abs=0.01) and solve[4] == pytest.approx(0.2, abs=0.01)


def test_a_recording_that_ends_in_mid_job_or_was_cut_off_says_so(scenario, tmp_path, capsys):
    bag = written(scenario, tmp_path, unfinished=True)
    file = bag_file(bag)
    file.write_bytes(file.read_bytes()[:-2000])
    kinds = {f.kind: f for f in faults_of(bag, load(bag))}
    assert "PUSHING" in kinds["no end"].text
    assert 9.0 < kinds["cut off"].time <= 10.0 and "cut off at" in kinds["cut off"].text
    assert main(["report", str(bag)]) == 0
    assert "the recording ends in mid-job" in capsys.readouterr().out
    text = (tmp_path / "bag-report" / "report.html").read_text()
    assert "the recording ends in the state PUSHING" in text


def parts(text):
    """Addresses that a file would load, and its inline data."""
    outside = re.findall(r"""(?:src|href)=["'](?!#)([^"']+)|url\(([^)]+)\)|@import""", text)
    (data,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)
    return outside, json.loads(data.replace("<\\/", "</"))


def test_the_file_needs_no_network(scenario, tmp_path):
    write_report(written(scenario, tmp_path), tmp_path / "out", animate=False)
    text = (tmp_path / "out" / "report.html").read_text()
    outside, data = parts(text)
    assert not outside and "default-src 'none'" in text
    assert not re.search(r"https?://(?!www\.w3\.org|github\.com/leeoniya/uPlot)", text)
    assert [bag["bodies"]["names"] for bag in data] == [["r0", "r1", "box0"]]
    assert "in a &lt;/script&gt; wall" in text


def study(folder):
    """Twenty trials in two scenarios; every fifth fails and lacks a measure."""
    folder.mkdir()
    rows = []
    for k in range(20):
        row = {"scenario": f"env{k % 2}", "seed": k, "success": k % 5 > 0, "duration_s": 10.0 + k}
        rows.append(row | ({} if k % 5 == 0 else {"position_error_m": 1e-4 * k}))
    aggregate = {
        "trials": 20,
        "success": 0.8,
        "duration_s": {"mean": 19.5, "std": 5.8, "max": 29.0},
    }
    summary = {"experiment": "made", "seed": 1, "requested": 25, "trials": rows}
    (folder / "summary.json").write_text(json.dumps({**summary, "aggregate": aggregate}))
    (folder / "report").mkdir()
    (folder / "report" / "report.html").write_text("of the recorded trial")
    return folder, rows


def test_report_of_a_study(tmp_path, capsys):
    folder, rows = study(tmp_path / "study")
    assert grouping(rows) == "scenario"
    found = {m["name"]: m["groups"] for m in measures(rows, "scenario")}
    assert {k: len(v) for k, v in found["duration_s"].items()} == {"env0": 10, "env1": 10}
    assert len(found["position_error_m"]["env0"]) == 8 and "seed" not in found
    crashed = {"scenario": "env0", "seed": 99, "success": False, "crashed": True, "limit": 60.0}
    assert measures([*rows, crashed], "scenario") == measures(rows, "scenario")
    assert main(["report", str(folder)]) == 0 and "20 trials" in capsys.readouterr().out
    text = (folder / "report.html").read_text()
    outside, _ = parts(text)
    assert [a for a, _ in outside] == ["report/report.html"]
    assert "16 of 20 trials succeed" in text and "25 were asked for" in text
    (folder / "summary.json").write_text("{}")
    assert main(["report", str(folder)]) == 2
    assert "not a summary" in capsys.readouterr().err


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_reports_open_in_a_browser_without_an_error(scenario, tmp_path):
    write_report(written(scenario, tmp_path), tmp_path / "out", animate=False)
    folder, _ = study(tmp_path / "study")
    write_study_report(folder, folder / "report.html")
    browser = Browser(tmp_path / "profile")
    try:
        browser.open(f"file://{tmp_path}/out/report.html")
        now = "parseFloat(document.getElementById('now').textContent)"
        wait(browser, f"{now} === 10")  # it begins with the result
        assert browser.value("document.querySelectorAll('.chart').length") >= 2
        browser.value("document.querySelector('[data-time]').click()")
        wait(browser, f"{now} === 4")  # the collision
        browser.value("document.getElementById('go').click()")
        wait(browser, f"{now} > 4.2")
        size = {"width": 390, "height": 800, "deviceScaleFactor": 1, "mobile": False}
        browser.call("Emulation.setDeviceMetricsOverride", **size)
        sideways = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        wait(browser, f"{sideways} <= 0 && innerWidth === 390")
        browser.open(f"file://{folder}/report.html")
        head = "[...document.querySelectorAll('th')].filter((h) => h.textContent === 'duration_s')"
        browser.value(f"{head}.pop().click()")
        column = "[...document.querySelectorAll('table.sortable')].pop().tBodies[0].rows[0].cells"
        assert browser.value(f"{column}[3].textContent") == "10"
        browser.value(f"{head}.pop().click()")
        assert browser.value(f"{column}[3].textContent") == "29"
        assert browser.errors == []
    finally:
        browser.close()
