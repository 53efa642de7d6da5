"""The pages of docs against the code: error codes have their rows, and links lead somewhere."""

import argparse
import ast
import importlib
import re
import shlex
from enum import IntEnum
from functools import cache
from pathlib import Path

import pytest

from grasp_opt.group_control import GroupControlSettings
from grasp_opt.group_job import GroupJobSettings
from grasp_opt.group_push import GroupPushSettings
from grasp_opt.step_settings import StepSettings
from planar_push.main import parser
from push_model.jobs import JobError
from push_mpc.settings import ControllerSettings, MpcSettings, TrackerSettings
from push_mpc.task import TrackError
from push_mpc.torque_friction import FrictionTrustSettings
from push_mpc.torque_tracker import TorqueTrackerSettings
from push_mpc.wheel_slip_nmpc import WheelSlipSettings
from push_planner import PlanError, PlannerSettings
from push_planner.robot_path import RobotPathError
from push_scenario.bodies import load_object
from push_scenario.scenario import load_scenario
from push_study.study import experiment
from push_supervisor import SupervisorSettings
from swarm_push.agent import AgentSettings
from swarm_push.laws import LawSettings
from swarm_push.swarm_job import SwarmJobSettings

ROOT = Path(__file__).resolve().parents[1]
BUILT = ("start.md", "changelog.md", "contributing.md")  # copies that ``make docs`` makes
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"] + [
    p for p in sorted((ROOT / "docs").glob("*.md")) if p.name not in BUILT
]
ENUMS = {JobError: "MoveObject", PlanError: "PlanPush", TrackError: "FollowTrajectory"} | {
    RobotPathError: "PlanRobotPath"
}


def rows(section):
    """Names and numbers of the codes in the section of docs/errors.md that names an interface."""
    parts = (ROOT / "docs/errors.md").read_text().split("\n## ")[1:]
    (text,) = [p for p in parts if f"`{section}`" in p.splitlines()[0]]
    found = {}
    for name, number, meaning, remedy in re.findall(
        r"^\| `(\w+)` \| (\d+) \| (.+?) \| (.+?) \|$", text, re.M
    ):
        assert len(meaning) > 10 and len(remedy) > 5, name
        found[name] = int(number)
    return found


def interfaces():
    """Every action and service that has error codes, with them."""
    for path in sorted((ROOT / "push_msgs").glob("*/*.*")):
        if path.suffix in (".action", ".srv"):
            result = path.read_text().split("---")[1]
            codes = re.findall(r"^uint16 ([A-Z_]+)=(\d+)", result, re.M)
            if codes:
                yield path.stem, {name: int(number) for name, number in codes}


@pytest.mark.parametrize(("name", "codes"), list(interfaces()))
def test_every_code_of_an_interface_has_its_row_and_no_other_has(name, codes):
    assert rows(name) == codes


def test_every_error_enum_is_one_of_an_interface():
    found = set()
    for path in ROOT.glob("*/*.py"):
        for name in re.findall(r"^class (\w+Error)\((?:IntEnum|Enum)\)", path.read_text(), re.M):
            module = importlib.import_module(f"{path.parent.name}.{path.stem}")
            found.add(getattr(module, name))
    assert found == set(ENUMS)
    for kind, interface in ENUMS.items():
        assert issubclass(kind, IntEnum)
        assert {code.name: int(code) for code in kind}.items() <= rows(interface).items()


def anchor(heading):
    """As GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_and_pictures_lead_somewhere(page):
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", page.read_text()):
        name, _, place = target.partition("#")
        other = (page.parent / name).resolve() if name else page
        assert other.exists(), target
        if place:
            headings = re.findall(r"^#+ (.+)$", other.read_text(), re.M)
            assert place in map(anchor, headings), target


def test_no_line_of_a_page_is_a_comment():
    """MyST drops a line that begins with a percent sign, and tears its paragraph in two."""
    comments = [
        f"{page.name}: {line}"
        for page in PAGES
        for line in page.read_text().splitlines()
        if line.lstrip().startswith("%")
    ]
    assert not comments


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_files_that_a_page_names_exist(page):
    """Paths in back quotes: ``folder/file.py`` from the root, or a bare ``file.py`` anywhere."""
    known = {p.name for folder in ROOT.glob("[a-z]*/") for p in folder.rglob("*.py")}
    for name in re.findall(r"`((?:\w+/)*\w+\.(?:py|yaml|md))`", page.read_text()):
        if "/" in name:
            assert (ROOT / name).is_file(), name
        else:
            assert name in known or name.endswith((".yaml", ".md")), name


SECTIONS = {
    "planner": {"": PlannerSettings},
    "controller": {"": ControllerSettings, "mpc": MpcSettings, "tracker": TrackerSettings},
    "supervisor": {"": SupervisorSettings},
    "torque_controller": {
        "nmpc": WheelSlipSettings,
        "tracker": TorqueTrackerSettings,
        "friction": FrictionTrustSettings,
    },
    "group": {"": GroupJobSettings, "control": GroupControlSettings, "push": GroupPushSettings},
    "optimizer": {"": StepSettings},
    "swarm": {"": SwarmJobSettings, "law": LawSettings, "agents": AgentSettings},
}
SYSTEMS = [ROOT / "docs" / f"{name}.md" for name in ("single-robot", "group", "swarm", "torque")]


@pytest.mark.parametrize("page", SYSTEMS, ids=lambda p: p.name)
def test_defaults_that_a_page_tells_are_those_of_the_settings(page):
    found = re.findall(r"^\| (\w+) \| `([\w.]+)` \| (.+?) \| .+ \|$", page.read_text(), re.M)
    assert len(found) >= 5
    for node, name, told in found:
        section, _, field = name.rpartition(".")
        value = getattr(SECTIONS[node][section](), field)
        if isinstance(value, bool | str):
            assert told.strip("`") == (value if isinstance(value, str) else str(value).lower()), (
                name
            )
        else:
            number, _, unit = told.partition(" ")
            assert float(number) * (1e-3 if unit == "mm" else 1.0) == pytest.approx(value), name


WITH_TEXTS = sorted(
    path.relative_to(ROOT)
    for folder in sorted(ROOT.glob("[a-z]*/"))
    for path in folder.rglob("*.py")
    if folder.name not in ("tests", "build", "results") and "doc=" in path.read_text()
)


@pytest.mark.parametrize("path", WITH_TEXTS, ids=str)
def test_the_text_of_a_parameter_stands_alone(path):
    """As ``ros2 param describe`` shows it: a phrase of its own, that does not lean on another."""
    for node in ast.walk(ast.parse((ROOT / path).read_text())):
        if isinstance(node, ast.keyword) and node.arg == "doc":
            text = ast.literal_eval(node.value)
            assert len(text.split()) >= 2 and not text[0].islower(), text
            assert not re.search(r"likewise|meanwhile|^Of |^By |^At |^\(|that it |whoever", text), (
                text
            )


def test_each_file_of_the_how_to_is_named_and_valid(tmp_path):
    """All blocks but commands start with the name of their file; the suite reads the YAML files."""
    text = (ROOT / "docs/how-to.md").read_text()
    blocks = re.findall(r"^```(\w+)\n(.*?)^```", text, re.M | re.S)
    files = {}
    for language, block in blocks:
        assert language in ("sh", "yaml", "python"), language
        if language != "sh":
            name = re.match(r"# (my_\w+\.(?:yaml|py))\n", block)
            assert name, block
            assert name[1] not in files
            files[name[1]] = tmp_path / name[1]
            files[name[1]].write_text(block)
    objects = [p for p in files.values() if "contact_friction" in p.read_text()]
    assert len(objects) >= 2
    for path in objects:
        assert load_object(str(path)).contact_friction > 0
    scenarios = [p for n, p in files.items() if n.endswith("scenario.yaml")]
    assert len(scenarios) >= 3
    for path in scenarios:
        assert load_scenario(str(path)).goal is not None


def words_of(line):
    """Words after ``planar-push`` without a comment; None where a placeholder is among them."""
    start = re.search(r"(?:^|[ /])planar-push (.+)", re.split(r"  +#", line)[0])
    if start and not re.search(r"…|<|\[|\b[A-Z]{2,}\b(?!=)|\b[XYTFK]\b", start[1]):
        return shlex.split(start[1])
    return None


_parser = cache(parser)


def understood(words):
    """Options and choices exist, and so do the experiments, benches and scenarios."""
    parsed = _parser().parse_args(words)
    scenarios = {p.stem for p in (ROOT / "config/scenarios").glob("*.yaml")}
    if words[0] == "experiment":
        named = set(filter(None, parsed.scenarios.split(",")))
        assert named <= {*scenarios, *experiment(parsed.name).SCENARIOS}, words
    scenario = getattr(parsed, "scenario", None) or "short"
    assert scenario in scenarios or "/" in scenario or scenario.startswith("my_"), words


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_command_lines_of_a_page_are_understood(page):
    text = page.read_text()
    blocks = re.findall(r"^```(?:sh)?\n(.*?)^```", text, re.M | re.S)
    for line in (line for block in blocks for line in block.splitlines()):
        if words := words_of(line):
            understood(words)
    for line in re.findall(r"`((?:\.venv/bin/)?planar-push [^`\n]+)`", text):
        words = words_of(line)
        if words and words[0] in ("experiment", "bench", "demo", "launch") and len(words) > 1:
            understood(words)
        elif words:  # a mention of a command, perhaps of an option
            verb = importlib.import_module(f"planar_push.{words[0].replace('-', '_')}")
            options = argparse.ArgumentParser()
            verb.add_arguments(options)
            told = options.format_help()
            assert all(w in told for w in words[1:] if w.startswith("--")), line
