"""The tree is a wheel and an ament_python package at once: markers, entry points, shared files."""

import ast
import importlib
import re
import sys
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from push_bringup.node_kinds import MODULES

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_package_xml_says_what_pyproject_says():
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    assert package.attrib["format"] == "3"
    name = PROJECT["project"]["name"].replace("-", "_")
    assert package.findtext("name") == name
    assert package.findtext("version") == PROJECT["project"]["version"]
    assert package.findtext("license") == "Apache-2.0"
    assert package.findtext("export/build_type") == "ament_python"
    needed = {e.text for e in package.findall("exec_depend")}
    assert {"push_msgs", "rclpy"} <= needed
    assert (ROOT / "resource" / name).is_file()
    assert name in (ROOT / "setup.cfg").read_text()


def test_every_ros_package_that_is_imported_is_declared():
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    declared = {e.text for e in package.findall("exec_depend")}
    imported = set()
    for name in PROJECT["tool"]["setuptools"]["packages"]:
        folder = ROOT / name.replace(".", "/")
        for file in folder.glob("*.py"):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.ImportFrom) and node.module:
                    imported.add(node.module.split(".")[0])
                elif isinstance(node, ast.Import):
                    imported |= {a.name.split(".")[0] for a in node.names}
    ros = {n for n in imported if n == "rclpy" or n.endswith(("_msgs", "_srvs", "_interfaces"))}
    assert ros <= declared, ros - declared


def requirement(line):
    """Name of a requirement, as PyPI writes it."""
    return re.match(r"[A-Za-z0-9._-]+", line)[0].lower()


def key_of(name):
    """What package.xml calls a Python package."""
    if name in ROS_WHEELS:
        return ROS_WHEELS[name]
    return UBUNTU.get(name, f"python3-{name}-pip")


ROS_WHEELS = {
    "ros-jazzy-rclpy": "rclpy",
    "ros-jazzy-common-interfaces": "std_msgs",
    "push-msgs": "push_msgs",
}
UBUNTU = {"pyyaml": "python3-yaml"}
"""Packages that Ubuntu 24.04 has in a version that will do, with their keys."""


def test_package_xml_names_every_dependency_of_pyproject_and_nothing_else():
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    declared = {e.text for e in package.findall("exec_depend")}
    needed = {key_of(requirement(line)) for line in PROJECT["project"]["dependencies"]}
    assert needed <= declared, needed - declared
    python = {key for key in declared if key.startswith("python3-")}
    assert python <= needed, python - needed


def test_rosdep_yaml_has_every_key_that_rosdep_lacks_in_the_version_asked_for():
    rules = yaml.safe_load((ROOT / "rosdep.yaml").read_text())
    lines = {key_of(requirement(line)): line for line in PROJECT["project"]["dependencies"]}
    assert set(rules) == {key for key in lines if key.endswith("-pip")}
    for key, rule in rules.items():
        assert set(rule) == {"debian", "ubuntu"}
        for system in rule.values():
            assert system == {"pip": {"packages": [lines[key]]}}


def test_every_package_that_is_imported_is_a_dependency():
    """Third-party packages by the names that they are imported by; extras are optional."""
    of_pydantic = dict.fromkeys(("annotated_types", "pydantic_core"), "pydantic")
    names = {"yaml": "pyyaml", "PIL": "pillow", **of_pydantic}
    known = {requirement(line) for line in PROJECT["project"]["dependencies"]}
    extra = {"launch", "distributed", "dask", "motioncapture", "shapely", "pytest", "hypothesis"}
    extra |= {
        "gymnasium",
        "pettingzoo",
        "gym_pusht",
        "pymunk",
        "benchnpin",
        "gco",
        "torch",
        "mujoco",
    }
    ours = {name.split(".")[0] for name in PROJECT["tool"]["setuptools"]["packages"]}
    third = set()
    for package in ours - {"push_config", "benchmarks"}:
        for file in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.ImportFrom) and node.module and not node.level:
                    third.add(node.module.split(".")[0])
                elif isinstance(node, ast.Import):
                    third |= {a.name.split(".")[0] for a in node.names}
    ros = {n for n in third if n == "rclpy" or n.endswith(("_msgs", "_srvs", "_interfaces"))}
    third -= ours | ros | set(sys.stdlib_module_names)
    assert {names.get(n, n) for n in third} <= known | extra


def test_shared_files_are_where_ros_looks_for_them():
    files = PROJECT["tool"]["setuptools"]["data-files"]
    assert files["share/ament_index/resource_index/packages"] == ["resource/planar_push"]
    assert files["share/planar_push"] == ["package.xml"]
    for patterns in files.values():
        for pattern in patterns:
            assert list(ROOT.glob(pattern)), pattern
    shared = {p for patterns in files.values() for q in patterns for p in ROOT.glob(q)}
    assert set((ROOT / "config").rglob("*.yaml")) <= shared


@pytest.mark.parametrize("name", sorted(PROJECT["project"]["scripts"]))
def test_entry_points_resolve(name):
    module, function = PROJECT["project"]["scripts"][name].split(":")
    assert callable(getattr(importlib.import_module(module), function))


def test_every_node_has_an_entry_point_and_the_launcher_starts_the_same():
    scripts = PROJECT["project"]["scripts"]
    for kind, module in MODULES.items():
        assert scripts[kind] == f"{module}:main"


def test_every_package_of_the_tree_is_installed():
    listed = set(PROJECT["tool"]["setuptools"]["packages"])
    found = {
        str(p.parent.relative_to(ROOT)).replace("/", ".")
        for p in ROOT.rglob("__init__.py")
        if p.relative_to(ROOT).parts[0] not in ("tests", "examples", "build")
        and not p.relative_to(ROOT).parts[0].startswith(".venv")
    }
    assert found <= listed
