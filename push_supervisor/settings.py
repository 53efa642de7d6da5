"""Settings of the supervisor."""

from push_model.settings import bounded, settings


@settings
class SupervisorSettings:
    """Tolerances, patience and speeds of a job."""

    auto_execute: bool = bounded(
        True, doc="Whether a plan is executed at once, without a call of the service /execute."
    )
    position_tolerance: float = bounded(
        0.012,
        low=1e-3,
        high=1.0,
        doc="Distance of the object from its goal at which it has arrived (m).",
    )
    orientation_tolerance: float = bounded(
        0.06,
        low=1e-3,
        high=3.2,
        doc="Angle of the object from its goal at which it has arrived (rad).",
    )
    correct_position: float = bounded(
        0.004,
        low=1e-4,
        high=1.0,
        doc="Distance of the object from its goal above which the job makes a further plan at its "
        "end to correct the error, although the object has arrived (m).",
    )
    correct_orientation: float = bounded(
        0.04,
        low=1e-3,
        high=3.2,
        doc="Angle of the object from its goal above which the job makes a further plan at its "
        "end to correct the error, although the object has arrived (rad).",
    )
    max_corrections: int = bounded(
        1,
        low=0,
        high=100,
        doc="Maximum number of further plans in a job that only correct the error of an object "
        "that has arrived. With 0, a job ends as soon as the object has arrived.",
    )
    displacement: float = bounded(
        0.02,
        low=1e-3,
        high=1.0,
        doc="Distance of the object from the planned start of a push at which the plan is dropped, "
        "because somebody has moved the object (m).",
    )
    displacement_turn: float = bounded(
        0.12,
        low=1e-3,
        high=3.2,
        doc="Angle of the object from the planned start of a push at which the plan is dropped, "
        "because somebody has moved the object (rad).",
    )
    max_replans: int = bounded(
        4,
        low=0,
        high=100,
        doc="Maximum number of new plans in a row without progress. A push makes progress if "
        "fewer pushes are left after it than after any earlier push. The same number limits how "
        "often the object may be displaced by others before a push is completed.",
    )
    max_retries: int = bounded(
        2,
        low=0,
        high=100,
        doc="Number of further attempts in a row to position the robot at a side of the object.",
    )
    max_losses: int = bounded(
        40,
        low=0,
        high=10000,
        doc="Number of times in a row that the controller node may be lost before the job fails.",
    )
    max_waits: int = bounded(
        10,
        low=0,
        high=10000,
        doc="Maximum number of interruptions in a row by other bodies: waits until they clear the "
        "path of the robot, and new plans because they are on the path of a push.",
    )
    repair_time: float = bounded(
        1.0,
        low=0.0,
        high=60.0,
        doc="Time that the robot goes on with a push while a new plan is made, when the goal has "
        "moved or a later part of the plan is blocked (s). If there is no plan 0.5 s before "
        "the end of this time, the robot backs off, and a plan is made from where the object is "
        "then. With less than 0.7 the robot always backs off first.",
    )
    wait: float = bounded(
        3.0,
        low=0.1,
        high=600.0,
        doc="Duration of one wait until other bodies clear the path of the robot, in pose time "
        "(s).",
    )
    approach_speed: float = bounded(
        0.1,
        low=1e-3,
        high=2.0,
        doc="Greatest speed of the robot when it approaches the object and backs off from it "
        "(m/s).",
    )
    acceleration: float = bounded(
        0.3,
        low=1e-3,
        high=10.0,
        doc="Acceleration of the robot when it begins to approach the object, and when it backs "
        "off from it (m/s^2).",
    )
    contact_braking: float = bounded(
        0.2,
        low=1e-3,
        high=10.0,
        doc="Deceleration of the robot at the end of its approach, when it touches the object "
        "(m/s^2); a lower value makes the contact gentler if the pose of the object is not exact.",
    )
    detach_distance: float = bounded(
        0.06, low=5e-3, high=2.0, doc="Distance that the robot backs off after a push (m)."
    )
    obstacle_margin: float = bounded(
        0.008,
        low=0.0,
        high=1.0,
        doc="Least distance between the robot's body and an obstacle (m).",
    )
    heartbeat_timeout: float = bounded(
        0.25,
        low=0.05,
        high=10.0,
        doc="Time without a heartbeat of the supervisor after which the robot stops (s).",
    )
    controller_timeout: float = bounded(
        1.0,
        low=0.2,
        high=60.0,
        doc="Time without feedback of the controller after which it counts as lost (s). In "
        "real time, both pose time and wall time must exceed it; in lockstep only pose "
        "time.",
    )
    node_timeout: float = bounded(
        20.0,
        low=0.5,
        high=600.0,
        doc="Time to wait for a node that is not in the ROS graph (s): wall time, or pose time "
        "in lockstep.",
    )
    answer_timeout: float = bounded(
        10.0,
        low=0.5,
        high=600.0,
        doc="Wall time without feedback of the planner after which the request is repeated "
        "(s). In lockstep: pose time, and only after the planner has left the ROS graph.",
    )
    pose_timeout: float = bounded(
        5.0,
        low=0.2,
        high=60.0,
        doc="Wall time without poses after which they count as lost (s). There is no limit in "
        "lockstep, because there the world waits for the controllers.",
    )
