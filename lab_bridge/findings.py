"""What a diagnosis says: a code, a sentence, and what to do."""

from dataclasses import dataclass
from enum import Enum


class Weight(Enum):
    """error: nothing can work. warning: it works badly. fact: for information."""

    ERROR = "error"
    WARNING = "warning"
    FACT = "fact"


@dataclass(frozen=True)
class Finding:
    """One thing that was found. code: upper-case name. what: a sentence. remedy: what to do."""

    weight: Weight
    code: str
    what: str
    remedy: str = ""

    def __str__(self) -> str:
        text = f"{self.weight.value}: {self.code}: {self.what}"
        return f"{text}\n    {self.remedy}" if self.remedy else text


def error(code: str, what: str, remedy: str) -> Finding:
    """Nothing can work until it is mended."""
    return Finding(Weight.ERROR, code, what, remedy)


def warning(code: str, what: str, remedy: str) -> Finding:
    """It works, but badly."""
    return Finding(Weight.WARNING, code, what, remedy)


def fact(code: str, what: str) -> Finding:
    """For information."""
    return Finding(Weight.FACT, code, what)
