"""Settings of the job of a swarm."""

from push_model.settings import bounded, settings
from swarm_push.arrival import ArrivalSettings
from swarm_push.liveness import LivenessSettings


@settings
class SwarmJobSettings(ArrivalSettings, LivenessSettings):
    """When a target is reached, when a job is given up, and how robots move."""

    orientation: bool = bounded(
        True,
        doc="Whether the heading of a goal pose is pursued; if false, the object may arrive "
        "with any heading",
    )
    stalled: float = bounded(
        90.0,
        low=1.0,
        high=3600.0,
        doc="Time without the object coming closer to its target after which the job fails (s)",
    )
    doubtful: float = bounded(
        30.0,
        low=1.0,
        high=3600.0,
        doc="Time without the object coming closer to its target after which the job fails, if the "
        "robots are hardly sufficient: their traction is little more than needed, or a single "
        "robot is left to turn the object (s)",
    )
    alone: float = bounded(
        10.0,
        low=0.0,
        high=3600.0,
        doc="Time after which the job fails if the robots that carry out commands are too few "
        "to move the object (s)",
    )
    apart: float = bounded(4e-3, low=0.0, high=1.0, doc="Gap that robots keep between them (m)")
    closing: float = bounded(
        3.0,
        low=0.01,
        high=100.0,
        doc="Highest closing speed of two robots, divided by the gap between them in excess of "
        "'apart' (1/s)",
    )
    lead: float = bounded(
        0.025,
        low=1e-3,
        high=1.0,
        doc="Distance ahead of the axle of the point whose velocity a robot on wheels controls (m)",
    )
