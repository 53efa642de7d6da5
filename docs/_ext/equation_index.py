"""docs/equations.md: which docstring cites which equation and algorithm of the thesis.

``python docs/_ext/equation_index.py`` writes the page. A test holds it against the code.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "equations.md"
PACKAGES = (
    *("push_model", "push_qp", "push_estimation", "push_planner", "push_mpc", "push_supervisor"),
    *("grasp_opt", "swarm_push", "sim_bridge", "lab_bridge", "push_job", "push_bringup"),
    *("push_study", "benchmarks"),
)
LAST = {2: 62, 3: 25, 4: 8}  # of each chapter
ALGORITHMS = (1, 2, 3, 4)
SUBJECTS = {
    2: "Chapter 2: one robot",
    3: "Chapter 3: groups",
    4: "Chapter 4: swarms",
}
_HEAD = (
    "# Equations and code\n\n"
    "This page tells where each numbered equation and algorithm of the thesis is cited in the\n"
    "code. A file alone stands for the docstring of the module. The names after a colon are\n"
    "classes, functions and constants of the file whose docstrings cite the number.\n"
    "[Errata](errata.md) explains the equations that are printed with an error.\n"
    "`python docs/_ext/equation_index.py` writes this page, and a test compares it with the code.\n"
)
_RANGE = re.compile(r"\(([2-4])\.(\d+)[a-h]?\)(?:\s*-\s*\((\d)\.(\d+)[a-h]?\))?")
_ALGORITHM = re.compile(r"Algorithms? (\d)(?:(?: and | or |, )(\d))?")

Place = tuple[str, str]
"""A file from the root, and the name of class or function in it; empty for the module."""


def equations(text: str) -> Iterator[tuple[int, int]]:
    """Numbers (chapter, equation) that a text cites; of a range, all."""
    for chapter, first, _, last in _RANGE.findall(text):
        for number in range(int(first), int(last or first) + 1):
            yield int(chapter), number


def algorithms(text: str) -> Iterator[int]:
    """Numbers of the algorithms that a text cites."""
    for found in _ALGORITHM.findall(text):
        yield from (int(n) for n in found if n)


def docstrings(tree: ast.AST, name: str = "") -> Iterator[tuple[str, str]]:
    """Name and docstring of a module and all that is in it; texts below a constant are its own."""
    body = getattr(tree, "body", [])
    for k, child in enumerate(body if isinstance(body, list) else []):
        inner = f"{name}.{child.name}".strip(".") if hasattr(child, "name") else ""
        if isinstance(child, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            yield from docstrings(child, inner)
        elif isinstance(child, ast.Expr) and isinstance(getattr(child.value, "value", None), str):
            owner = _target(body[k - 1]) if k else ""
            yield (f"{name}.{owner}".strip(".") if owner else name), child.value.value


def _target(node: ast.AST | None) -> str:
    target = getattr(node, "target", None) or next(iter(getattr(node, "targets", [])), None)
    return target.id if isinstance(target, ast.Name) else ""


def index() -> tuple[dict[tuple[int, int], list[Place]], dict[int, list[Place]]]:
    """Places that cite each equation, and each algorithm, in the order of the house."""
    of_equations: dict[tuple[int, int], list[Place]] = {}
    of_algorithms: dict[int, list[Place]] = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            file = str(path.relative_to(ROOT))
            for name, text in docstrings(ast.parse(path.read_text())):
                for number in dict.fromkeys(equations(text)):
                    of_equations.setdefault(number, []).append((file, name))
                for algorithm in dict.fromkeys(algorithms(text)):
                    of_algorithms.setdefault(algorithm, []).append((file, name))
    return of_equations, of_algorithms


def page() -> str:
    """The page's text."""
    found, algorithms_found = index()
    parts = [_HEAD]
    for chapter, title in SUBJECTS.items():
        parts.append(f"\n## {title}\n\n| equation | where |\n|---|---|\n")
        for number in range(1, LAST[chapter] + 1):
            places = found.get((chapter, number), [])
            parts.append(f"| ({chapter}.{number}) | {_cell(places)} |\n")
    parts.append("\n## Algorithms\n\n| algorithm | where |\n|---|---|\n")
    parts += [f"| {k} | {_cell(algorithms_found.get(k, []))} |\n" for k in ALGORITHMS]
    return "".join(parts)


def _cell(places: list[Place]) -> str:
    """Names by file; the module itself where nothing in it cites the number."""
    files: dict[str, list[str]] = {}
    for file, name in places:
        files.setdefault(file, []).append(name)
    cells = []
    for file, names in files.items():
        inner = ", ".join(f"`{n}`" for n in dict.fromkeys(names) if n)
        cells.append(f"`{file}`" + (f": {inner}" if inner else ""))
    return "; ".join(cells)


if __name__ == "__main__":
    PAGE.write_text(page())
