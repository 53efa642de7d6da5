"""Namespaces of the teams of a world, read from the graph."""

from collections.abc import Sequence

_JOBS, _POSES = "push_msgs/msg/JobState", "push_msgs/msg/Poses"


def team_spaces(
    topics: Sequence[tuple[str, Sequence[str]]], world: str, own: str
) -> tuple[str, ...]:
    """Namespaces of the teams of a world, with a slash at the end; that of the viewer first.

    A namespace with a ``job_state`` below the world's is a team. A team below a nested world (a
    namespace with its own ``poses``) belongs to that world.

    Parameters
    ----------
    topics: names and types, as rclpy gives them. world: namespace of the world, ``/`` or ``/a/``.
    own: namespace of the viewer.
    """
    jobs, worlds = [], []
    for name, types in topics:
        space, _, last = name.rpartition("/")
        space += "/"
        if last == "job_state" and _JOBS in types and space.startswith(world):
            jobs.append(space)
        elif last == "poses" and _POSES in types and not space.endswith("/ground_truth/"):
            worlds.append(space)
    inner = [w for w in worlds if w != world and w.startswith(world)]
    found = [s for s in jobs if not any(s.startswith(w) for w in inner)]
    return tuple(sorted(found, key=lambda s: (s != own, s)))
