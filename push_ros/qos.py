"""Named QoS profiles; every publisher and subscription of the project takes one of these."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

STREAM = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Poses and the like: the newest counts, a lost one is not sent again."""

COMMAND = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""Velocity commands and goals."""

STATUS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""Status, diagnostics, markers."""

CHATTER = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
"""What all robots of a swarm say to each other."""

LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""Kept for late subscribers: map, plan, state."""

CLOCK = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""/clock, as rclpy subscribes to it."""


def deep(profile: QoSProfile) -> QoSProfile:
    """The same for a subscriber that wants every message, such as a recorder."""
    return QoSProfile(
        depth=max(profile.depth, 1000),
        reliability=profile.reliability,
        durability=profile.durability,
    )


BELIEF = QoSProfile(
    depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""Kept for late subscribers, from several sources."""
