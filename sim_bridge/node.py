"""The bridge node: the simulated world in place of real robots and motion capture."""

import math
import sys
import time
from typing import Any

from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage
from std_msgs.msg import Bool
from std_srvs.srv import SetBool
from visualization_msgs.msg import MarkerArray

from push_model.settings import SettingsError
from push_msgs.msg import Contacts, Poses
from push_msgs.srv import LoadScenario, Reset
from push_ros.conversions import (
    contacts_to_ros,
    grid_to_ros,
    poses_to_ros,
    time_from_ros,
    time_to_ros,
    transform_to_ros,
)
from push_ros.diagnostics import Diagnostics
from push_ros.names import names_of
from push_ros.parameters import declare_settings
from push_ros.process import run_node
from push_ros.qos import CLOCK, COMMAND, LATCHED, STATUS, STREAM
from push_scenario.scenario import Scenario, load_scenario
from sim_bridge.markers import body_markers
from sim_bridge.motion_capture import MotionCapture
from sim_bridge.pace import Lockstep, RealTime
from sim_bridge.settings import (
    BridgeSettings,
    MotionCaptureSettings,
    PhysicsSettings,
    steps_per_tick,
)
from sim_bridge.world import World
from tf2_msgs.msg import TFMessage


class BridgeNode(Node):
    """Publishes the pose stream, the map and the clock; drives the wheels from /<robot>/cmd_vel."""

    def __init__(
        self, scenario: Scenario | None = None, autostart: bool = True, namespace: str = ""
    ) -> None:
        super().__init__("bridge", namespace=namespace)
        self._names = names_of(self)
        name = self.declare_parameter("scenario", "env1-target1").value
        self._scenario = scenario or load_scenario(str(name))
        values = dict(self._scenario.parameters.get("bridge", {}))
        capture, physics = values.pop("motion_capture", {}), values.pop("physics", {})
        self.settings = declare_settings(self, BridgeSettings, values, where="bridge")
        self._capture_settings = declare_settings(
            self, MotionCaptureSettings, capture, "motion_capture", "bridge.motion_capture"
        )
        self._physics = declare_settings(
            self, PhysicsSettings, physics, "physics", "bridge.physics"
        )
        self._steps = steps_per_tick(self._physics, self._capture_settings)
        self.period = 1.0 / self._capture_settings.rate
        self._decimation = max(1, round(self._capture_settings.rate / self.settings.tf_rate))
        self._diagnostics = Diagnostics(self, self._names, self._state)
        self._make_publishers()
        self._lockstep = Lockstep()
        self._pace = RealTime(self.period, self.settings.real_time_factor)
        self._seed = self.settings.seed
        self.world: World | None = None
        self.running = False
        self._paused = False
        self._autostart = autostart
        self.lockstep_timeouts = 0
        self._build()
        self.create_service(Reset, "~/reset", self._on_reset)
        self.create_service(LoadScenario, "~/load_scenario", self._on_load)
        self.create_service(SetBool, "~/pause", self._on_pause)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        wall = 0.05 if self.settings.lockstep else self.period / self.settings.real_time_factor
        self._timer = self.create_timer(max(wall, 1e-3), self._on_timer, clock=steady)

    def _make_publishers(self) -> None:
        name = self._names.world
        events = self._diagnostics.publisher_events
        self._clock_publisher = self.create_publisher(ClockMessage, name("clock"), CLOCK)
        self._poses_publisher = self.create_publisher(
            Poses, name("poses"), STREAM, event_callbacks=events(name("poses"))
        )
        self._diagnostics.watch_publishers(name("poses"))
        self._truth_publisher = self.create_publisher(Poses, name("ground_truth/poses"), STREAM)
        self._contacts_publisher = self.create_publisher(Contacts, name("contacts"), STREAM)
        self._tf_publisher = self.create_publisher(TFMessage, name("tf"), STATUS)
        self._marker_publisher = self.create_publisher(MarkerArray, name("visualization"), STATUS)
        self._map_publisher = self.create_publisher(OccupancyGrid, name("map"), LATCHED)
        self._pause_publisher = self.create_publisher(Bool, name("paused"), LATCHED)
        self._pause_publisher.publish(Bool(data=False))
        self._inputs: list[Any] = []

    def _build(self) -> None:
        """Make the scenario's world and start it from tick 0."""
        if self.world is not None:
            self.world.close()
        s = self._scenario
        self.world = World(s.environment, s.robots, s.objects, self._physics)
        self._map_publisher.publish(grid_to_ros(s.grid, 0.0))
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        self._inputs = []
        for robot in s.robots:
            topic = self._names.robot(robot, "cmd_vel")
            self._inputs.append(
                self.create_subscription(
                    TwistStamped,
                    topic,
                    lambda m, r=robot: self._on_command(r, m),
                    COMMAND,
                    event_callbacks=self._diagnostics.subscription_events(topic),
                )
            )
        self._restart()

    def _restart(self) -> None:
        self.tick = 0
        self._capture = MotionCapture(self._capture_settings, self._seed)
        self._last_tick: dict[str, int] = {}
        self._last_wall: dict[str, float] = {}
        self._commanded = self.commanded()
        self._pace.restart()
        self._lockstep.expect(0, (), time.monotonic())
        self._driving: dict[str, bool] = dict.fromkeys(self._scenario.robots, False)

    @property
    def time(self) -> float:
        """[s] sim time."""
        return self.tick * self.period

    def commanded(self) -> list[str]:
        """Robots that somebody publishes commands for."""
        return [
            r
            for r in self._scenario.robots
            if self.count_publishers(self._names.robot(r, "cmd_vel")) > 0
        ]

    def heard_by(self, count: int) -> bool:
        """Whether so many listen to the poses."""
        return bool(self.count_subscribers(self._names.world("poses")) >= count)

    def start(self) -> None:
        """Begin to step, in lockstep mode too."""
        self._commanded = self.commanded()
        self.running = True
        if self.settings.lockstep:
            self._advance()

    def _on_timer(self) -> None:
        if self._paused:
            return
        if not self.running:
            # A lockstep run waits for its controllers; a live one shows the scene at once.
            if self._autostart and (
                not self.settings.lockstep or len(self.commanded()) == len(self._scenario.robots)
            ):
                self.start()
            return
        now = time.monotonic()
        if not self.settings.lockstep:
            for _ in range(self._pace.due(now)):
                self._tick()
            return
        late = self._lockstep.overdue(now, self.settings.lockstep_timeout)
        if late or self._lockstep.ready:
            if late:
                self.lockstep_timeouts += 1
                self.get_logger().warning(f"no answer to tick {self.tick} from {', '.join(late)}")
                for robot in late:
                    self._stop(robot)
                self._commanded = self.commanded()
            self._advance()

    def _advance(self) -> None:
        """Lockstep: tick until somebody must answer."""
        while self.running and not self._paused:
            stamp = self._tick()
            if stamp is not None:
                self._lockstep.expect(stamp, self._commanded, time.monotonic())
            if not self._lockstep.ready or not self._commanded:
                return

    def _on_command(self, robot: str, message: TwistStamped) -> None:
        if robot not in self._scenario.robots:
            return  # one that is gone with the last scenario
        v, omega = message.twist.linear.x, message.twist.angular.z
        limit = 10.0 * self._scenario.robots[robot][0].max_speed
        turn_limit = 10.0 * self._scenario.robots[robot][0].max_turn_rate
        topic = self._names.robot(robot, "cmd_vel")
        if not (math.isfinite(v) and math.isfinite(omega)):
            self._diagnostics.refuse(topic, f"not finite: v={v}, omega={omega}")
            return
        if abs(v) > limit or abs(omega) > turn_limit:
            self._diagnostics.refuse(topic, f"absurd: v={v:.3g} m/s, omega={omega:.3g} rad/s")
            return
        stamp = round(time_from_ros(message.header.stamp) / self.period)
        allowed = self.settings.command_timeout / self.period
        allowed += self._capture_settings.latency / self.period
        if stamp <= 0 or not self.tick - allowed <= stamp <= self.tick:
            self._diagnostics.refuse(
                topic, f"stamp {stamp * self.period:.2f} s at {self.time:.2f} s is not a fresh one"
            )
            return
        assert self.world is not None
        self.world.command(robot, v, omega)
        self._driving[robot] = v != 0.0 or omega != 0.0
        self._last_tick[robot], self._last_wall[robot] = self.tick, time.monotonic()
        if self.settings.lockstep and self.running:
            if robot not in self._commanded:
                self._commanded = self.commanded()
            self._lockstep.answer(stamp, robot)
            if self._lockstep.ready:  # while paused it is kept for later
                self._advance()

    def driving(self, robot: str) -> bool:
        """Whether the robot's last command was to move, and still holds."""
        return self._driving[robot]

    def _stop(self, robot: str) -> None:
        assert self.world is not None
        self.world.command(robot, 0.0, 0.0)
        self._driving[robot] = False

    def _watch(self) -> None:
        """A robot without a fresh command stops."""
        limit = round(self.settings.command_timeout / self.period)
        limit += round(self._capture_settings.latency / self.period)
        now = time.monotonic()
        for robot, driving in self._driving.items():
            if not driving:
                continue
            late = self.tick - self._last_tick[robot] > limit
            if not self.settings.lockstep:
                late |= now - self._last_wall[robot] > self.settings.command_timeout_wall
            if late:
                self.get_logger().warning(f"{robot}: no fresh command, wheels stopped")
                self._stop(robot)

    def _tick(self) -> int | None:
        """Step the physics by one control tick and publish; the stamp of the frame published."""
        assert self.world is not None
        self._watch()
        self.world.step(self._steps)
        self.tick += 1
        stamp = time_to_ros(self.time)
        truth = self.world.poses()
        self._clock_publisher.publish(ClockMessage(clock=stamp))
        # messages that nobody reads are not even made
        if self._truth_publisher.get_subscription_count():
            self._truth_publisher.publish(poses_to_ros(truth, self.time))
        contacts = self.world.read_contacts()
        if self._contacts_publisher.get_subscription_count():
            self._contacts_publisher.publish(contacts_to_ros(contacts, self.time))
        if self.tick % self._decimation == 0:
            if self._tf_publisher.get_subscription_count():
                transforms = [transform_to_ros(n, p, self.time) for n, p in truth.items()]
                self._tf_publisher.publish(TFMessage(transforms=transforms))
            if (
                self.tick % (5 * self._decimation) == 0
                and self._marker_publisher.get_subscription_count()
            ):
                self._marker_publisher.publish(body_markers(self._scenario, truth, self.time))
        frame = self._capture.observe(self.tick, truth)
        if frame is None:
            return None
        self._poses_publisher.publish(poses_to_ros(frame.poses, frame.stamp * self.period))
        return frame.stamp

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
        self._pause_publisher.publish(Bool(data=self._paused))
        self._pace.restart()
        response.success, response.message = True, "paused" if self._paused else "running"
        return response

    def _state(self) -> dict[str, Any]:
        return {
            "sim time": f"{self.time:.2f}",
            "scenario": self._scenario.name,
            "lockstep timeouts": self.lockstep_timeouts,
            "stalls": self._pace.stalls,
            "paused": self._paused,
        }

    def destroy_node(self) -> None:
        """Close the world too."""
        if self.world is not None:
            self.world.close()
            self.world = None
        super().destroy_node()


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(BridgeNode)


if __name__ == "__main__":
    sys.exit(main())
