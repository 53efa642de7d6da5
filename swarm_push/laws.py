"""The laws by name. A further one is a file like these, its settings, and a row here."""

from dataclasses import dataclass, field
from typing import Literal

from push_model.arrays import Array
from push_model.settings import bounded, settings
from push_model.specs import ObjectSpec
from swarm_push.crescent_law import CrescentLaw, CrescentLawSettings
from swarm_push.law import SwarmLaw
from swarm_push.thesis_law import ThesisLaw, ThesisLawSettings
from swarm_push.walls import Walls


@settings
class LawSettings:
    """Which law moves a swarm."""

    law: Literal["crescent", "thesis"] = bounded(
        "crescent",
        doc="Control law of the swarm: 'crescent' moves a density along the part of the object's "
        "outline that robots must push; 'thesis' is the law of chapter 4 of the thesis as "
        "printed, with its errata corrected",
    )


@dataclass(frozen=True)
class LawSections:
    """Settings of all laws, of which one is used."""

    law: LawSettings = field(default_factory=LawSettings)
    crescent: CrescentLawSettings = field(default_factory=CrescentLawSettings)
    thesis: ThesisLawSettings = field(default_factory=ThesisLawSettings)


def make_law(
    sections: LawSections,
    region: Array,
    item: ObjectSpec,
    radius: float,
    speed: float,
    walls: Walls | None = None,
) -> SwarmLaw:
    """For round robots of a radius [m] and a greatest speed [m/s] that push an object in a convex
    region ``(m, 2)`` [m] of their centres; walls: what stands in it, of which the printed law knows
    nothing."""
    if sections.law.law == "thesis":
        return ThesisLaw(region, item, sections.thesis)
    return CrescentLaw(region, item, radius, speed, sections.crescent, walls)
