"""How steps of a group are planned."""

from push_model.settings import bounded, settings


@settings
class StepSettings:
    """Room, speeds, and how sure a placement must be."""

    room: float = bounded(
        0.03,
        low=0.0,
        high=1.0,
        doc="Preferred clearance of the object's path from obstacles, in addition to the diameter "
        "of a robot (m).",
    )
    clearance: float = bounded(
        0.01, low=0.0, high=1.0, doc="Least clearance of robots to obstacles between pushes (m)."
    )
    gap: float = bounded(
        0.015,
        low=0.0,
        high=1.0,
        doc="Least gap between the bodies of two robots that push to a goal (m).",
    )
    standoff: float = bounded(
        0.012,
        low=1e-3,
        high=0.5,
        doc="Distance from the object at which robots wait before they make contact (m).",
    )
    back: float = bounded(
        0.05,
        low=0.0,
        high=1.0,
        doc="Length of the straight last part of a robot's path to its place at the object (m).",
    )
    speed: float = bounded(
        0.05, low=1e-3, high=5.0, doc="Highest speed of any point of a pushed object (m/s)."
    )
    acceleration: float = bounded(
        0.05,
        low=1e-3,
        high=50.0,
        doc="Highest acceleration of any point of a pushed object (m/s^2).",
    )
    force_share: float = bounded(
        0.85,
        low=0.1,
        high=1.0,
        doc="Fraction of its traction that a robot may use (dimensionless).",
    )
    margin: float = bounded(
        0.1,
        low=0.0,
        high=1.0,
        doc="Margin of the grasp-task compatibility test (the sine of an angle) with which a "
        "placement is accepted; if no placement reaches this margin, more robots push, and if that "
        "does not help, a placement with less is used. A certified margin of 0 is enough, too "
        "(dimensionless).",
    )
    steps: int = bounded(
        8,
        low=5,
        high=1000,
        doc="Number N of time steps of the placement cost (3.16) of the thesis for one piece of "
        "the object's path.",
    )
    longest: float = bounded(
        1.5,
        low=0.05,
        high=100.0,
        doc="Greatest length of the piece of the object's path that one step covers (m).",
    )
