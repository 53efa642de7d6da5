"""The README's tables equal the running graph."""

import re
import time
from pathlib import Path

import pytest
from rclpy.action import (
    get_action_client_names_and_types_by_node,
    get_action_server_names_and_types_by_node,
)

from push_ros.claims import own_domain
from push_scenario.scenario import load_scenario, scenario_from_mapping
from push_study.graph_run import LockstepRun

ROOT = Path(__file__).resolve().parents[2]
ROBOT = "epuck1"
NODES = {
    "bridge": ("bridge", "/"),
    "planner": ("planner", "/"),
    "controller": ("controller", f"/{ROBOT}"),
    "supervisor": ("supervisor", "/"),
}
OF_ALL = {"/rosout", "/parameter_events", "/diagnostics"}


def table(heading):
    """Rows of the first table that has this column heading, as lists of cells."""
    lines = (ROOT / "README.md").read_text().splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(f"| {heading} |"))
    rows = []
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            return rows
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    return rows


def names(cell):
    return {n.replace("<robot>", ROBOT) for n in re.findall(r"`([^`]+)`", cell)}


GROUP_NODES = {"group": ("group", "/"), "optimizer": ("optimizer", "/")}
SWARM_NODES = {"swarm": ("swarm", "/")}
AGENT_NODES = {"swarm_agent": (f"agent_{ROBOT}", "/")}
ESTIMATOR_NODES = {"estimator": ("estimator", "/")}
REARRANGE_NODES = {"rearranger": ("rearranger", "/")}
CROWD_NODES = {**REARRANGE_NODES, **GROUP_NODES, **SWARM_NODES, **AGENT_NODES, **ESTIMATOR_NODES}


@pytest.fixture(scope="module")
def graph():
    """Of every node: topics that it hears, topics that it tells, what it serves, what it asks."""
    return {
        **look(
            load_scenario("short").settings("estimator", enabled=True),
            "single",
            {**NODES, **ESTIMATOR_NODES},
        ),
        **look(load_scenario("rearrange"), "rearrange", REARRANGE_NODES),
        **look(load_scenario("group-ellipse"), "group", GROUP_NODES),
        **look(load_scenario("swarm-square"), "swarm", SWARM_NODES),
        **look(two_that_decide_for_themselves(), "swarm", AGENT_NODES),
    }


def two_that_decide_for_themselves():
    names = (ROBOT, "epuck2")
    values = {
        "environment": {"size": [3.0, 2.0]},
        "robots": {
            n: {"type": "epuck_ring", "start": [-1.0, 0.3 * i, 0.0]} for i, n in enumerate(names)
        },
        "objects": {"square": {"type": "swarm_square", "start": [0.0, 0.0, 0.0]}},
        "goal": [0.5, 0.0, 0.0],
        "parameters": {"swarm": {"agents": {"decentralised": True}}},
    }
    return scenario_from_mapping(values, "two", "test")


def look(scenario, system, nodes):
    """The graph, once it no longer changes: each node tells of its topics by messages."""
    with own_domain(), LockstepRun(scenario, system=system, quiet=True) as run:
        run.start()
        before = None
        for _ in range(100):
            complete, found = seen_by(run.observer, nodes)
            if complete and found == before:
                return found
            before = found
            time.sleep(0.2)
        raise AssertionError(f"the graph is not complete after 20 s: {found}")


def seen_by(me, nodes):
    """Whether every node tells its diagnostics, and what each does."""
    found, complete = {}, True
    for row, (name, space) in nodes.items():
        heard = {t for t, _ in me.get_subscriber_names_and_types_by_node(name, space)}
        told = {t for t, _ in me.get_publisher_names_and_types_by_node(name, space)}
        served = {t for t, _ in me.get_service_names_and_types_by_node(name, space)}
        own = f"{space.rstrip('/')}/{name}/"
        parameters = {
            s for s in served if s.startswith(own) and ("parameter" in s or "type_description" in s)
        }
        actions = {t for t, _ in get_action_server_names_and_types_by_node(me, name, space)}
        asked = {t for t, _ in me.get_client_names_and_types_by_node(name, space)}
        goals = {t for t, _ in get_action_client_names_and_types_by_node(me, name, space)}
        found[row] = (
            {t for t in heard if "/_action/" not in t} - OF_ALL,
            {t for t in told if "/_action/" not in t} - OF_ALL,
            {s for s in served - parameters if "/_action/" not in s} | actions,
            {s for s in asked if "/_action/" not in s} | goals,
        )
        complete &= "/diagnostics" in told
    return complete, found


def test_every_node_has_a_row_and_no_other():
    assert {row[0] for row in table("node")[:10]} == {*NODES, *CROWD_NODES}


@pytest.mark.parametrize("node", [*NODES, *CROWD_NODES])
def test_what_a_node_hears_tells_serves_and_asks(graph, node):
    (row,) = [r for r in table("node") if r[0] == node]
    for cell, actual in zip(row[1:], graph[node], strict=True):
        assert names(cell) == actual, node


def test_settings_and_their_defaults_exist():
    from grasp_opt.group_control import GroupControlSettings
    from grasp_opt.group_job import GroupJobSettings
    from grasp_opt.step_settings import StepSettings
    from push_mpc.settings import ControllerSettings, MpcSettings, TrackerSettings
    from push_planner import PlannerSettings
    from push_supervisor import SupervisorSettings
    from sim_bridge.settings import BridgeSettings, MotionCaptureSettings
    from swarm_push.agent import AgentSettings
    from swarm_push.laws import LawSettings
    from swarm_push.swarm_job import SwarmJobSettings

    known = {
        "bridge": (BridgeSettings(), {"motion_capture": MotionCaptureSettings()}),
        "planner": (PlannerSettings(), {}),
        "controller": (
            ControllerSettings(),
            {"mpc": MpcSettings(), "tracker": TrackerSettings()},
        ),
        "supervisor": (SupervisorSettings(), {}),
        "group": (GroupJobSettings(), {"control": GroupControlSettings()}),
        "optimizer": (StepSettings(), {}),
        "swarm": (SwarmJobSettings(), {"law": LawSettings(), "agents": AgentSettings()}),
    }
    lines = (ROOT / "README.md").read_text().splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("| node | parameter |"))
    rows = [line.strip("|").split("|") for line in lines[start + 2 :] if line.startswith("|")]
    checked = 0
    for node, cell, default, _ in [[c.strip() for c in r] for r in rows if r[0].strip() in known]:
        own, sections = known[node]
        first = ""
        for name in re.findall(r"`([^`]+)`", cell):
            full = first + name if name.startswith(".") else name
            section, _, field = full.rpartition(".")
            first = section
            value = getattr(sections[section] if section else own, field)
            number = re.match(r"[\d.]+", default)
            if number and len(re.findall(r"`", cell)) == 2 and isinstance(value, float):
                scale = 1e-3 if "mm" in default else 1.0
                assert value == pytest.approx(float(number.group()) * scale), full
            checked += 1
    assert checked >= 16
