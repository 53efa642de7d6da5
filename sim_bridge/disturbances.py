"""The events of a scenario: bodies are moved, killed, removed or hidden at given times."""

from collections.abc import Sequence

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.settings import SettingsError
from push_scenario.events import Displace, Event, Kill, Place, Remove
from push_scenario.footing import Footing
from sim_bridge.motion_capture import MotionCapture
from sim_bridge.world import World

_LATE = 1e-9  # [s] by which the time of a tick may fall short


class Disturbances:
    """The events of a scenario, each carried out once, at the first tick of its time or later."""

    def __init__(self, events: Sequence[Event], rate: float, footing: Footing) -> None:
        """rate: [Hz] of the control ticks. footing: where bodies can be put."""
        self._events = sorted(events, key=lambda e: e.at)
        self._rate = rate
        self._footing = footing
        self.restart()

    def restart(self) -> None:
        """Start again at the beginning of the scenario."""
        self._pending = list(self._events)

    def add(self, event: Event) -> None:
        """Add an event. It happens at the first tick after its time; a restart drops it."""
        self._pending = sorted([*self._pending, event], key=lambda e: e.at)

    def apply(self, tick: int, world: World, capture: MotionCapture) -> list[str]:
        """Carry out the events that are due at a tick. Returns a sentence for each."""
        done = []
        while self._pending and self._pending[0].at <= tick / self._rate + _LATE:
            done.append(self._carry_out(self._pending.pop(0), tick, world, capture))
        return done

    def _carry_out(self, event: Event, tick: int, world: World, capture: MotionCapture) -> str:
        if isinstance(event, Kill):
            world.kill(event.robot)
            return f"{event.robot} obeys no more"
        if isinstance(event, Remove):
            world.remove(event.robot)
            return f"{event.robot} is gone"
        if isinstance(event, Displace | Place):
            if event.body not in world.names:
                return f"{event.body} is gone and cannot be moved"
            if isinstance(event, Displace):
                return shove(world, event.body, np.array(event.by), self._footing)
            try:
                pose = np.array(event.pose, dtype=np.float64)
                return displace(world, event.body, pose, self._footing)
            except SettingsError as error:
                return str(error)
        capture.hide(event.bodies, tick + round(event.duration * self._rate) + 1)
        return f"{', '.join(event.bodies)} unseen for {event.duration:g} s"


def displace(world: World, name: str, pose: Array, footing: Footing) -> str:
    """Put a body at a pose ``(3,)``; what was done.

    Raises
    ------
    SettingsError: there is no such body, the pose is not one, or something else is there.
    """
    if name not in world.names:
        raise SettingsError(f"no body '{name}'; there are: {', '.join(world.names)}")
    if not np.isfinite(pose).all():
        raise SettingsError(f"{name} cannot be put at {pose.tolist()}: the pose is not finite")
    pose = np.array([pose[0], pose[1], se2.wrap(float(pose[2]))])
    trouble = footing.trouble(name, pose, world.poses())
    if trouble is not None:
        raise SettingsError(f"{name} cannot be put at {_words(pose)}: it would be {trouble}")
    world.place(name, pose)
    return f"{name} is put at {_words(pose)}"


def shove(world: World, name: str, by: Array, footing: Footing) -> str:
    """Move a body by ``(3,)`` [m, m, rad] along the world's axes, as far as nothing is in its way;
    what was done."""
    pose, stopped = footing.along(name, by, world.poses())
    world.place(name, pose)
    done = f"{name} is moved to {_words(pose)}"
    return done if stopped is None else f"{done}; farther on it would be {stopped}"


def _words(pose: Array) -> str:
    return f"({pose[0]:.3f}, {pose[1]:.3f}, {pose[2]:.3f})"
