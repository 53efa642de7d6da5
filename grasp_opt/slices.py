"""Long work in slices: a generator that yields nothing, again and again, and returns its result.

Whoever runs it may do something else between two slices, or give up. Where the slices end depends
on the work alone, not on time, so that a run in lockstep can be repeated.
"""

from collections.abc import Generator
from typing import TypeVar

Result = TypeVar("Result")
Work = Generator[None, None, Result]
"""Work in slices that returns a result."""


def finish(work: Work[Result]) -> Result:
    """Do all of the work at once."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            result: Result = end.value
            return result
