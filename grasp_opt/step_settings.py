"""How steps of a group are planned."""

from push_model.settings import bounded, settings


@settings
class StepSettings:
    """Room, speeds, and how sure a placement must be."""

    room: float = bounded(
        0.03,
        low=0.0,
        high=1.0,
        doc="free space wanted around the object in addition to a robot diameter (m)",
    )
    clearance: float = bounded(
        0.01, low=0.0, high=1.0, doc="least clearance of robots on their paths (m)"
    )
    gap: float = bounded(
        0.015, low=0.0, high=1.0, doc="least gap between robots that push together (m)"
    )
    standoff: float = bounded(
        0.012,
        low=1e-3,
        high=0.5,
        doc="distance from the object at which robots wait before contact (m)",
    )
    back: float = bounded(
        0.05, low=0.0, high=1.0, doc="straight last part of the path to a place at the object (m)"
    )
    speed: float = bounded(
        0.05, low=1e-3, high=5.0, doc="greatest speed of any point of the object (m/s)"
    )
    acceleration: float = bounded(
        0.05, low=1e-3, high=50.0, doc="greatest acceleration of any point of the object (m/s^2)"
    )
    force_share: float = bounded(
        0.85, low=0.1, high=1.0, doc="fraction of its traction that a robot may use"
    )
    margin: float = bounded(
        0.1,
        low=0.0,
        high=1.0,
        doc="margin of the compatibility test that makes more robots unnecessary, a sine",
    )
    steps: int = bounded(
        8, low=5, high=1000, doc="number N of time steps of (3.16) for a piece with one twist"
    )
    longest: float = bounded(
        1.5,
        low=0.05,
        high=100.0,
        doc="longest piece of the way before the next step is planned (m)",
    )
