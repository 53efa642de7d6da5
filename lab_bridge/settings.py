"""Settings of the lab bridge: its pace, and the limits that keep a lab safe."""

from push_model.settings import bounded, settings


@settings
class LabBridgeSettings:
    """Pace, safety and publishing of the lab bridge."""

    tick: float = bounded(
        0.01,
        low=1e-3,
        high=0.1,
        doc="Period at which the lab bridge checks the robots and the time limits (s).",
    )
    command_rate: float = bounded(
        60.0,
        low=1.0,
        high=1000.0,
        doc="Greatest number of commands per second to one robot (Hz). A stop is never delayed.",
    )
    command_timeout: float = bounded(
        0.2,
        low=0.01,
        high=5.0,
        doc="A robot is stopped when the frame of poses that its last command answers is older "
        "than this (s).",
    )
    pose_timeout: float = bounded(
        0.25,
        low=0.02,
        high=5.0,
        doc="Time without poses after which all robots are stopped (s).",
    )
    assembly: float = bounded(
        0.004,
        low=0.0,
        high=0.1,
        doc="Longest time that a frame waits for bodies whose poses arrive one by one (s).",
    )
    max_speed: float = bounded(
        0.5, low=1e-3, high=20.0, doc="Greatest speed that is sent to a robot (m/s)."
    )
    max_turn_rate: float = bounded(
        10.0, low=1e-2, high=100.0, doc="Greatest turn rate that is sent to a robot (rad/s)."
    )
    max_tilt: float = bounded(
        0.35,
        low=0.01,
        high=3.2,
        doc="Greatest angle between the vertical axis of a body and that of the map (rad). A pose "
        "with a greater tilt is rejected.",
    )
    pause_when_lost: bool = bounded(
        True,
        doc="Whether all robots stop while the connection to one of them is lost. Otherwise only "
        "that robot stops.",
    )
    discovery_time: float = bounded(
        0.5,
        low=0.0,
        high=10.0,
        doc="Time to look for another bridge before this one starts (s).",
    )
    tf_rate: float = bounded(25.0, low=0.1, high=1000.0, doc="Transforms on /tf per second (Hz).")
