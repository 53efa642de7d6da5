"""Sphinx extension: pages that are made when the site is built.

``docs/api`` has one page for each package, with the docstrings of its public names. README,
CHANGELOG and CONTRIBUTING of the project become pages of the site. Git ignores all of them.
"""

import ast
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
FOLDER = DOCS / "api"
COPIES = {
    "README.md": "start.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
}
PACKAGES = (
    *("push_job", "push_model", "push_scenario", "push_estimation", "push_qp", "push_planner"),
    *("push_mpc", "push_supervisor", "grasp_opt", "swarm_push", "sim_bridge", "lab_bridge"),
    *("push_ros", "push_record", "push_view", "push_gym", "push_bringup", "push_study"),
)
_HEAD = """# API

Public modules by package, made from their docstrings. [Architecture](../architecture.md) says
what a package is for. Start with these:

- `push_bringup.suite`: run nodes from Python.
- `push_study.graph_run`: the same in lockstep.
- `push_job.method`: a method of your own.
- `push_scenario.scenario`: scenario files.
"""


def write_pages(app: Any = None) -> None:
    """Write ``docs/api`` and the copies."""
    for source, target in COPIES.items():
        _write(DOCS / target, _relinked((ROOT / source).read_text()))
    FOLDER.mkdir(exist_ok=True)
    tree = "\n".join(PACKAGES)
    _write(FOLDER / "index.md", f"{_HEAD}\n```{{toctree}}\n:maxdepth: 1\n\n{tree}\n```\n")
    for package in PACKAGES:
        _write(FOLDER / f"{package}.md", _page(package))


def _relinked(text: str) -> str:
    """Links of a page of the project's root as those of a page in ``docs``."""
    text = text.replace("](docs/", "](")
    for source, target in COPIES.items():
        text = re.sub(rf"\]\({source}(?=[)#])", f"]({target}", text)
    return text


def relink(app: Any, name: str, source: list[str]) -> None:
    """Links from ``docs`` to pages of the root, as those to their copies."""
    for page, target in COPIES.items():
        source[0] = source[0].replace(f"](../{page}", f"]({target}")


def _page(package: str) -> str:
    folder = ROOT / package
    text = ast.get_docstring(ast.parse((folder / "__init__.py").read_text())) or ""
    parts = [f"# {package}\n\n{text}\n"]
    for path in sorted(folder.rglob("*.py")):
        if path.name.startswith("_") or not (path.parent / "__init__.py").exists():
            continue
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        parts.append(f"\n## {name}\n\n```{{eval-rst}}\n.. automodule:: {name}\n```\n")
    return "".join(parts)


def _write(path: Path, text: str) -> None:
    """Only what has changed, so that Sphinx does not read all pages again."""
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("builder-inited", write_pages)
    app.connect("source-read", relink)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
