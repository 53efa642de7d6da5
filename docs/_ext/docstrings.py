"""Sphinx extension: docstrings of this project as reStructuredText.

They are plain text: paragraphs; sections underlined with dashes; entries ``name: text``; indented
formulas. Only double back quotes mark something up.
"""

import re
from collections.abc import Iterator
from typing import Any

_ENTRY = re.compile(r"^(\w+(?: ``[^`]+``)?(?:, \w+(?: ``[^`]+``)?)*): (.*)")
_LITERAL = re.compile(r"(``.+?``)")


def escape(text: str) -> str:
    """Text whose only markup is ``literals``."""
    parts = _LITERAL.split(text)
    return "".join(p if p.startswith("``") else re.sub(r"([*|_`\\])", r"\\\1", p) for p in parts)


def paragraphs(lines: list[str]) -> Iterator[list[str]]:
    """Lines between empty ones."""
    found: list[str] = []
    for line in [*lines, ""]:
        if line.strip():
            found.append(line.rstrip())
        elif found:
            yield found
            found = []


def rendered(lines: list[str]) -> list[str]:
    """reStructuredText of a docstring."""
    out: list[str] = []
    for number, block in enumerate(paragraphs(lines)):
        if len(block) > 1 and re.fullmatch(r"-{3,}", block[1]):
            out += [f"**{block[0]}**", ""]
            block = block[2:]
            out += [*_entries(block), ""] if block else []
        elif all(line.startswith("    ") for line in block):
            out += ["::", "", *block, ""]
        elif number and _ENTRY.match(block[0]):
            out += [*_entries(block), ""]
        else:
            out += [escape(re.sub("::$", ":", " ".join(line.strip() for line in block))), ""]
    return out


def _entries(block: list[str]) -> Iterator[str]:
    """A list of ``name: text``; a line that names nothing continues the one before."""
    items: list[tuple[str, str]] = []
    for line in block:
        found = None if line.startswith(" ") else _ENTRY.match(line)
        if found:
            items.append((f"- {_name(found[1])}: ", found[2]))
        elif items:
            items[-1] = (items[-1][0], f"{items[-1][1]} {line.strip()}")
        else:
            items.append(("", line.strip()))
    yield from (head + escape(text) for head, text in items)


def _name(text: str) -> str:
    """Names in bold, with the shapes that stand beside them as they are."""
    parts = _LITERAL.split(text)
    return "".join(p if p.startswith("``") else re.sub(r"(\w+)", r"**\1**", p) for p in parts)


def process(app: Any, kind: str, name: str, item: Any, options: Any, lines: list[str]) -> None:
    """Called by autodoc for each docstring."""
    lines[:] = rendered(lines)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", process)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
