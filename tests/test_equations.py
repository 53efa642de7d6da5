"""docs/equations.md leads from every numbered equation of the thesis to its code."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "docs" / "_ext"))

import equation_index  # noqa: E402


def test_the_page_is_what_the_code_says():
    again = "run: python docs/_ext/equation_index.py"
    assert equation_index.PAGE.read_text() == equation_index.page(), again


def test_every_equation_and_algorithm_is_in_the_code():
    found, algorithms = equation_index.index()
    wanted = {(c, n) for c, last in equation_index.LAST.items() for n in range(1, last + 1)}
    assert wanted - found.keys() == set() and found.keys() <= wanted
    assert set(algorithms) == set(equation_index.ALGORITHMS)


def test_ranges_and_parts_count():
    cited = list(equation_index.equations("(2.19a)-(2.22), (3.1), section 2.4"))
    assert cited == [(2, 19), (2, 20), (2, 21), (2, 22), (3, 1)]
    assert list(equation_index.algorithms("Algorithms 1 and 2; Algorithm 4")) == [1, 2, 4]


def test_names_are_those_of_the_code():
    for file, name in {p for places in equation_index.index()[0].values() for p in places}:
        text = (ROOT / file).read_text()
        assert not name or name.split(".")[-1] in text, (file, name)
