"""Where topics, services and actions are: in the world's namespace, a robot's, or a team's.

The bridge and what it publishes live in the world's namespace; a robot's topics in one below it,
named after the robot; what a team is told and tells (goals, jobs, plans) in the team's. Without
teams the team's namespace is the world's, and that is the namespace that the node was started in.
Nothing is found by the name of a node.
"""

from dataclasses import dataclass

from rclpy.node import Node


@dataclass(frozen=True)
class Names:
    """Namespaces with a slash at the end: ``/`` or ``/a/``."""

    world_space: str
    team_space: str

    def world(self, topic: str) -> str:
        """Full name of something of the world's, e.g. ``poses``."""
        return self.world_space + topic

    def team(self, topic: str) -> str:
        """Full name of something of the team's, e.g. ``goal_pose``."""
        return self.team_space + topic

    def robot(self, robot: str, topic: str) -> str:
        """Full name of something of a robot's, e.g. ``cmd_vel``."""
        return f"{self.world_space}{robot}/{topic}"


def space(namespace: str) -> str:
    """A namespace as a prefix: with one slash at each end."""
    inner = namespace.strip("/")
    return f"/{inner}/" if inner else "/"


def inside(namespace: str, inner: str) -> str:
    """A namespace inside another one, for the start of a node."""
    return space(namespace) + inner.strip("/")


def names_of(node: Node, world: str = "") -> Names:
    """The names that a node uses; declares its parameter ``world``.

    world: default of the parameter: namespace of the bridge, where it is not the node's own.
    """
    given = str(node.declare_parameter("world", world).value)
    team = space(node.get_namespace())
    return Names(space(given) if given else team, team)


def names_of_robot(node: Node, robot: str) -> Names:
    """The names of a node that belongs to one robot.

    It lives in the robot's namespace; started elsewhere, it takes that one for the world's.
    """
    own = space(node.get_namespace())
    world = own.removesuffix(f"{robot}/") if own.endswith(f"/{robot}/") else own
    return Names(world, world)
