"""The pages of docs against the code: error codes have their rows, and links lead somewhere."""

import importlib
import re
from enum import IntEnum
from pathlib import Path

import pytest

from push_model.jobs import JobError
from push_mpc.task import TrackError
from push_planner import PlanError
from push_planner.robot_path import RobotPathError

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
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


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_files_that_a_page_names_exist(page):
    """Paths in back quotes: ``folder/file.py`` from the root, or a bare ``file.py`` anywhere."""
    known = {p.name for p in ROOT.glob("*/**/*.py")}
    for name in re.findall(r"`((?:\w+/)*\w+\.(?:py|yaml|md))`", page.read_text()):
        if "/" in name:
            assert (ROOT / name).is_file(), name
        else:
            assert name in known or name.endswith((".yaml", ".md")), name
