"""Settings of the job of a swarm."""

from push_model.settings import bounded, settings
from swarm_push.arrival import ArrivalSettings
from swarm_push.liveness import LivenessSettings


@settings
class SwarmJobSettings(ArrivalSettings, LivenessSettings):
    """When a target is reached, when a job is given up, and how robots move."""

    orientation: bool = bounded(
        True, doc="Whether the heading of a goal pose is pursued; if false, any heading will do"
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
        doc="The same time when the robots are only just enough: their traction is little more "
        "than the motion needs, or one robot is left to turn an object (s)",
    )
    alone: float = bounded(
        10.0,
        low=0.0,
        high=3600.0,
        doc="Time without enough robots to move the object, because none carries out its commands "
        "or their traction is not enough, after which the job fails (s)",
    )
    apart: float = bounded(4e-3, low=0.0, high=1.0, doc="Gap that robots keep between them (m)")
    closing: float = bounded(
        3.0,
        low=0.01,
        high=100.0,
        doc="Closing speed that is allowed between two robots, divided by the gap between them "
        "that exceeds the one to be kept (1/s)",
    )
    lead: float = bounded(
        0.025,
        low=1e-3,
        high=1.0,
        doc="Distance ahead of the axle of the point whose velocity a robot on wheels controls (m)",
    )
