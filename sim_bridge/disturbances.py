"""What happens to a scenario's bodies at given times: moved, killed, removed, unseen."""

from collections.abc import Sequence

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.settings import SettingsError
from push_scenario.events import Displace, Event, Kill, Place, Remove
from sim_bridge.motion_capture import MotionCapture
from sim_bridge.world import World

_LATE = 1e-9  # [s] by which the time of a tick may fall short


class Disturbances:
    """The events of a scenario, each carried out once, at the first tick of its time or later."""

    def __init__(self, events: Sequence[Event], rate: float) -> None:
        """rate: [Hz] of the control ticks."""
        self._events = sorted(events, key=lambda e: e.at)
        self._rate = rate
        self.restart()

    def restart(self) -> None:
        """From the beginning of the scenario."""
        self._next = 0

    def apply(self, tick: int, world: World, capture: MotionCapture) -> list[str]:
        """Carry out what is due at a tick; a sentence for each."""
        done = []
        while self._next < len(self._events):
            event = self._events[self._next]
            if event.at > tick / self._rate + _LATE:
                break
            self._next += 1
            done.append(self._carry_out(event, tick, world, capture))
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
            if isinstance(event, Place):
                return displace(world, event.body, np.array(event.pose, dtype=np.float64))
            return displace(world, event.body, world.poses()[event.body] + np.array(event.by))
        capture.hide(event.bodies, tick + round(event.duration * self._rate) + 1)
        return f"{', '.join(event.bodies)} unseen for {event.duration:g} s"


def displace(world: World, name: str, pose: Array) -> str:
    """Put a body at a pose ``(3,)``; what was done.

    Raises
    ------
    SettingsError: there is no such body, or the pose is not one.
    """
    if name not in world.names:
        raise SettingsError(f"no body '{name}'; there are: {', '.join(world.names)}")
    if not np.isfinite(pose).all():
        raise SettingsError(f"{name} cannot be put at {pose.tolist()}")
    pose = np.array([pose[0], pose[1], se2.wrap(float(pose[2]))])
    world.place(name, pose)
    return f"{name} is put at ({pose[0]:.3f}, {pose[1]:.3f}, {pose[2]:.3f})"
