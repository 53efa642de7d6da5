"""Environments for learning: docs/learning.md says how to install them, then ``import push_gym``.

``gymnasium.make("PlanarPush/Single-v0")``, ``-Group-v0`` and ``-Swarm-v0``;
``gymnasium.make_vec(…, num_envs=64)`` for many rooms in one compiled call; and
``push_gym.parallel_env("group")`` for PettingZoo.
"""

from typing import Any

from gymnasium.envs.registration import register, registry

from push_gym.env import PlanarPushEnv
from push_gym.settings import SYSTEMS, EnvSettings
from push_gym.vector_env import PlanarPushVectorEnv

__all__ = [
    "ENVIRONMENTS",
    "EnvSettings",
    "PlanarPushEnv",
    "PlanarPushVectorEnv",
    "parallel_env",
    "register_all",
]

ENVIRONMENTS = {f"PlanarPush/{system.capitalize()}-v0": system for system in SYSTEMS}
"""Systems by the names that ``gymnasium.make`` takes."""


def register_all() -> None:
    """Make the environments known to Gymnasium; done by the import of this package."""
    for name, system in ENVIRONMENTS.items():
        if name not in registry:
            register(
                name,
                entry_point="push_gym.env:PlanarPushEnv",
                vector_entry_point="push_gym.vector_env:PlanarPushVectorEnv",
                kwargs={"system": system},
            )


def parallel_env(system: str = "group", **values: Any) -> Any:
    """PettingZoo's parallel environment of a system; see ``PlanarPushParallelEnv``."""
    from push_gym.parallel import PlanarPushParallelEnv

    return PlanarPushParallelEnv(system, **values)


register_all()
