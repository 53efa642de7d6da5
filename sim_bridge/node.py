"""The bridge node: a simulated world in place of real robots and motion capture."""

import math
import sys
import time
from collections.abc import Callable
from typing import IO, Any

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_srvs.srv import SetBool

from push_model.arrays import Rows
from push_model.se2 import compose, pose
from push_model.settings import SettingsError
from push_msgs.srv import Displace, Kill, LoadScenario, Reset
from push_ros.command_intake import CommandIntake
from push_ros.diagnostics import Diagnostics
from push_ros.lone_bridge import refuse_second_bridge
from push_ros.names import Names, space
from push_ros.parameters import declare_settings
from push_ros.process import run_node
from push_ros.scheduling import Urgency
from push_ros.services import CALLS, Services
from push_ros.validation import FARTHEST
from push_scenario.events import Event
from push_scenario.footing import Footing
from push_scenario.scenario import Scenario, load_scenario
from sim_bridge.disturbances import Disturbances, displace
from sim_bridge.motion_capture import MotionCapture
from sim_bridge.pace import Lockstep, RealTime
from sim_bridge.settings import BridgeSettings, MotionCaptureSettings
from sim_bridge.world import BodyContacts, BodyPoses, World
from sim_bridge.world_publishers import WorldPublishers
from sim_bridge.worlds import steps_of, world_kind

Witness = Callable[[float, BodyPoses, BodyContacts], None]
"""Of a time [s], the true poses, and the contacts of the tick that ends then."""

_PATIENT = 0.2  # [s] wall time without an answer until the bridge looks who is in the graph
_SHOWN = 5  # names in a warning


class BridgeNode(Node):
    """Steps a world at a pace, moves its robots as they are commanded, publishes what is seen."""

    def __init__(
        self, scenario: Scenario | None = None, autostart: bool = True, namespace: str = ""
    ) -> None:
        """Make the world of a scenario.

        autostart: start to step alone; False: somebody calls ``start``.

        Raises
        ------
        SettingsError: a setting is wrong, or a bridge already runs here.
        """
        super().__init__("bridge", namespace=namespace)
        here = space(self.get_namespace())
        self._names = Names(here, here)  # the world's namespace is where the bridge is
        name = self.declare_parameter("scenario", "env1-target1").value
        self._scenario = scenario or load_scenario(str(name))
        values = dict(self._scenario.parameters.get("bridge", {}))
        capture, physics = values.pop("motion_capture", {}), values.pop("physics", {})
        self.settings = declare_settings(self, BridgeSettings, values, where="bridge")
        self._capture_settings = declare_settings(
            self, MotionCaptureSettings, capture, "motion_capture", "bridge.motion_capture"
        )
        self._kind = world_kind(self.settings.world)
        self._physics = declare_settings(
            self, self._kind.settings, physics, "physics", "bridge.physics"
        )
        self._claim: IO[str] | None = None
        if autostart:
            self._claim = refuse_second_bridge(self, self._names, self.settings.discovery_time)
        self._rate = self._capture_settings.rate
        self.period = 1.0 / self._rate
        self._decimation = max(1, round(self._rate / self.settings.tf_rate))
        self._diagnostics = Diagnostics(self, self._names, self._state)
        self.outputs = WorldPublishers(self, self._names, self._diagnostics, self.settings.lockstep)
        self._intake = CommandIntake(self, self._names, self._diagnostics, self._on_answered)
        self._pace = RealTime(self.period, self.settings.real_time_factor)
        self._seed = self.settings.seed
        self.world: World | None = None
        self.witness: Witness | None = None
        """Told what is so after every tick, for evaluation in the same process. Nothing that moves
        a robot may know it."""
        self.running = False
        self._paused = False
        self._autostart = autostart
        self.unanswered = 0
        """Ticks in lockstep that went on without an answer, because a commander had left."""
        self._build()
        at = self._names.world
        services = Services(self, at(CALLS), lambda: self.time)
        services.serve(Reset, at("bridge/reset"), self._on_reset)
        services.serve(LoadScenario, at("bridge/load_scenario"), self._on_load)
        services.serve(SetBool, at("bridge/pause"), self._on_pause)
        services.serve(Kill, at("bridge/kill"), self._on_kill)
        services.serve(Displace, at("displace"), self._on_displace)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        wall = 0.05 if self.settings.lockstep else self.period / self.settings.real_time_factor
        self._timer = self.create_timer(max(wall, 1e-3), self._on_timer, clock=steady)

    def _build(self) -> None:
        """Make the scenario's world and start it from tick 0."""
        if self.world is not None:
            self.world.close()
        s = self._scenario
        self.world = self._kind.make(s.environment, s.robots, s.objects, self._physics, self.period)
        self._steps = steps_of(self.period, self.world.time_step)
        self._capture = MotionCapture(self._capture_settings, self._seed)
        self._footing = Footing(s)
        self._disturbances = Disturbances(s.events, self._rate, self._footing)
        self.outputs.scenario(s)
        late = self._capture.longest_latency
        wall = math.inf if self.settings.lockstep else self.settings.command_timeout_wall
        types = {robot: spec for robot, (spec, _) in s.robots.items()}
        self._intake.connect(self.world, types, self.settings.command_timeout + late, wall)
        self._restart()

    def _restart(self) -> None:
        self.tick = 0
        self.outputs.begin()
        self._capture.reset(self._seed)
        self._disturbances.restart()
        self._intake.restart()
        self._intake.now = 0.0
        self._commanded = self._intake.commanded()
        self._pace.restart()
        self._lockstep = Lockstep(len(self._scenario.robots))

    @property
    def time(self) -> float:
        """[s] sim time."""
        return float(self.tick / self._rate)

    @property
    def in_real_time(self) -> bool:
        """Whether robots and controllers must keep a pace, which they need not in lockstep."""
        return not self.settings.lockstep

    @property
    def applied_latency(self) -> tuple[float, float]:
        """[s] Mean and standard deviation of the latency of the poses since the start."""
        return self._capture.applied_latency

    def commanded(self) -> list[str]:
        """The robots for which a node publishes commands."""
        return self._named(np.flatnonzero(self._intake.commanded()))

    def _named(self, rows: Rows) -> list[str]:
        return [self._intake.gate.names[row] for row in rows]

    def _listed(self, rows: Rows) -> str:
        """Names of robots as text for a message."""
        more = f" and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
        return ", ".join(self._named(rows[:_SHOWN])) + more

    def heard_by(self, count: int) -> bool:
        """Whether so many nodes subscribe to the poses."""
        return bool(self.count_subscribers(self._names.world("poses")) >= count)

    def driving(self, robot: str) -> bool:
        """Whether the robot's last command was to move, and still holds."""
        gate = self._intake.gate
        return bool(gate.driving[gate.rows([robot])[0]])

    def start(self) -> None:
        """Begin to step, in lockstep mode too."""
        self._commanded = self._intake.commanded()
        self.running = True
        if self.settings.lockstep:
            self._advance()

    def disturb(self, event: Event) -> None:
        """Add an event to those of the scenario. It happens now or at its time."""
        self._disturbances.add(event)

    def _on_timer(self) -> None:
        if self._paused:
            return
        if not self.running:
            # A lockstep run waits for its controllers; a live one shows the scene at once.
            if self._autostart and (not self.settings.lockstep or self._intake.commanded().all()):
                self.start()
            return
        now = time.monotonic()
        if not self.settings.lockstep:
            for _ in range(self._pace.due(now)):
                self._tick()
            return
        if not self._lockstep.ready and self._lockstep.waited(now) > _PATIENT:
            self._release_abandoned()
        if self._lockstep.ready:
            self._advance()
        elif self._lockstep.due_to_tell(now, self.settings.lockstep_warning):
            names = self._listed(self._lockstep.waiting)
            self.get_logger().warning(
                f"no answer to tick {self.tick} from {names}; the simulation keeps waiting"
            )

    def _release_abandoned(self) -> None:
        """Stop the robots whose commanding node has left the graph, and do not wait for them."""
        rows = self._intake.abandoned(self._lockstep.waiting)
        if not rows.size:
            return
        self.unanswered += 1
        text = f"whoever commanded {self._listed(rows)} has left; stopped at tick {self.tick}"
        self.get_logger().warning(text)
        self._intake.stop(rows)
        self._intake.forget(rows)
        self._commanded = self._intake.commanded()
        self._lockstep.release(rows)

    def _advance(self) -> None:
        """In lockstep: tick until an answer of a robot is needed."""
        while self.running and not self._paused:
            frame = self._tick()
            if frame is not None:
                self._lockstep.expect(frame, self._commanded, time.monotonic())
            if not self._lockstep.ready or not self._commanded.any():
                return

    def _on_answered(self, stamp: float, rows: Rows) -> None:
        """Handle an answer to the poses of a stamp [s], for some robots."""
        if not (self.settings.lockstep and self.running):
            return
        if self._intake.changed or not self._commanded[rows].all():
            self._recount()
        newest = self._lockstep.answer(_number_of(stamp), rows)
        if newest and not self._lockstep.ready and self._intake.all_have_spoken(stamp):
            self._lockstep.release(self._intake.drop_unnamed(self._lockstep.waiting))
        if self._lockstep.ready:  # while paused it is kept for later
            self._advance()

    def _recount(self) -> None:
        """Update which robots are commanded. Lockstep waits only for these."""
        self._commanded = self._intake.commanded()
        self._lockstep.release(np.flatnonzero(~self._commanded))

    def _tick(self) -> int | None:
        """Step the physics by one control tick and publish; the number of the frame published."""
        assert self.world is not None
        world, outputs = self.world, self.outputs
        for robot in self._named(self._intake.watch(self.time)):
            self.get_logger().warning(f"{robot} receives no fresh commands; its wheels are stopped")
        done = self._disturbances.apply(self.tick, world, self._capture)
        if done:
            self.get_logger().info("; ".join(done))
            self._recount()
        touching = outputs.contacts_heard or self.witness is not None
        world.step(self._steps, contacts=touching)
        self.tick += 1
        self._intake.now = self.time
        poses = world.poses()
        contacts = world.read_contacts() if touching else None
        outputs.truth(world, poses, contacts, self.tick, self.time)
        if self.witness is not None and contacts is not None:
            self.witness(self.time, poses, contacts)
        frame = self._capture.observe(self.tick, poses)
        if frame is None:
            return None
        measured = frame.stamp / self._rate
        self._intake.note_seen(frame.poses.names)
        outputs.seen(frame, measured)
        if self.tick % self._decimation == 0:
            outputs.look(self._scenario, frame, self.tick // self._decimation, measured)
        return _number_of(measured)

    def _on_reset(self, request: Any, response: Any) -> Any:
        assert self.world is not None
        self.world.reset()
        if request.seed:
            self._seed = int(request.seed)
        self._restart()
        response.success, response.message = True, "the world is back at its start"
        return response

    def _on_load(self, request: Any, response: Any) -> Any:
        try:
            self._scenario = load_scenario(request.scenario)
            self._build()
            response.success, response.message = True, f"loaded {self._scenario.name}"
        except SettingsError as error:
            response.success, response.message = False, str(error)
        return response

    def _on_pause(self, request: Any, response: Any) -> Any:
        self._paused = bool(request.data)
        self.outputs.paused(self._paused)
        self._pace.restart()
        response.success, response.message = True, "paused" if self._paused else "running"
        return response

    def _on_displace(self, request: Any, response: Any) -> Any:
        assert self.world is not None
        place = pose(request.x, request.y, request.theta)
        try:
            if request.relative and request.name in self.world.names:
                place = compose(self.world.poses()[request.name], place)
            if not np.abs(place).max() <= FARTHEST:
                raise SettingsError(f"{place.tolist()} is not a plausible pose")
            response.message = displace(self.world, request.name, place, self._footing)
            response.success = True
        except SettingsError as error:
            response.success, response.message = False, str(error)
        return response

    def _on_kill(self, request: Any, response: Any) -> Any:
        assert self.world is not None
        response.success = request.robot in self._scenario.robots
        if response.success:
            self.world.kill(request.robot)
            response.message = f"{request.robot} obeys no more, until the world is reset"
        else:
            known = ", ".join(list(self._scenario.robots)[:_SHOWN])
            response.message = f"no robot '{request.robot}'; there are: {known}"
        return response

    def _state(self) -> dict[str, Any]:
        return {
            "sim time": f"{self.time:.2f}",
            "scenario": self._scenario.name,
            "unanswered ticks": self.unanswered,
            "stalls": self._pace.stalls,
            "paused": self._paused,
        }

    def destroy_node(self) -> None:
        """Also close the world and release its claim."""
        if self._claim is not None:
            self._claim.close()
        if self.world is not None:
            self.world.close()
            self.world = None
        super().destroy_node()


def _number_of(stamp: float) -> int:
    """The number of the frame with a stamp [s]: the stamp in nanoseconds, as in messages."""
    return round(1e9 * stamp)


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(BridgeNode, urgency=Urgency.WORLD)


if __name__ == "__main__":
    sys.exit(main())
