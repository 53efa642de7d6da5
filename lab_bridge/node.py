"""The lab bridge node: real motion capture and real robots behind the topics of the simulation."""

import os
import sys
import time
from collections.abc import Mapping
from functools import partial
from typing import IO, Any

import numpy as np
from nav_msgs.msg import OccupancyGrid
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool

from lab_bridge.crowding import Crowding
from lab_bridge.fleet import Fleet
from lab_bridge.guard import Guard
from lab_bridge.lab_clock import LabClock
from lab_bridge.pose_drivers import PoseHost, make_pose_driver
from lab_bridge.pose_intake import Clocks, PoseIntake
from lab_bridge.robot_drivers import RobotHost, make_robot_driver
from lab_bridge.settings import LabBridgeSettings
from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_model.arrays import Array
from push_model.belief import POSES, Interval
from push_model.drives import TorqueDrive
from push_model.settings import SettingsError
from push_msgs.msg import Belief as BeliefMessage
from push_msgs.msg import Poses
from push_ros.command_intake import CommandIntake
from push_ros.conversions import frame_to_ros, grid_to_ros, transform_to_ros
from push_ros.diagnostics import Diagnostics
from push_ros.lone_bridge import refuse_second_bridge
from push_ros.names import Names, space
from push_ros.parameters import declare_settings
from push_ros.process import run_node
from push_ros.qos import BELIEF, LATCHED, STATUS, STREAM
from push_ros.report_conversions import belief_to_ros
from push_ros.scheduling import Urgency
from push_ros.services import CALLS, Services
from push_scenario.lab import EPuck2Link, LabSettings, TransformSource
from push_scenario.scenario import Scenario, load_scenario
from tf2_msgs.msg import TFMessage

_SOURCE = "lab_bridge"  # of what it says on /belief


class LabBridgeNode(Node):
    """Publishes what motion capture sees; lets robots move as they are commanded."""

    def __init__(self, scenario: Scenario | None = None, namespace: str = "") -> None:
        """Connect to motion capture and robots.

        Raises
        ------
        SettingsError: a setting or a driver is wrong, or a bridge already runs here.
        """
        super().__init__("bridge", namespace=namespace)
        here = space(self.get_namespace())
        self._names = Names(here, here)
        name = self.declare_parameter("scenario", "").value
        self.scenario = scenario or load_scenario(str(name))
        lab = self.scenario.lab
        if self.scenario.on != "lab" or lab is None:
            raise SettingsError(f"scenario '{self.scenario.name}' is not for a lab ('on: lab')")
        self._specs = {robot: spec for robot, (spec, _) in self.scenario.robots.items()}
        for robot, spec in self._specs.items():
            if isinstance(spec.drive, TorqueDrive):
                raise SettingsError(f"lab.robots.{robot}: no driver takes wheel torques")
        values = dict(self.scenario.parameters.get("lab_bridge", {}))
        gate = values.pop("poses", {})
        self.settings = declare_settings(self, LabBridgeSettings, values, where="lab_bridge")
        gate = declare_settings(self, PoseGateSettings, gate, "poses", "lab_bridge.poses")
        self._claim: IO[str] | None = refuse_second_bridge(
            self, self._names, self.settings.discovery_time
        )
        self._guard: Guard | None = None
        self._paused_by_hand = self._stopped = False
        self._paused: bool | None = None
        self._pose_clock = LabClock()
        self._next_tf = 0.0
        self._diagnostics = Diagnostics(self, self._names, self._state)
        self._make_outputs(lab)
        self.poses = PoseIntake(
            lab,
            (*self.scenario.robots, *self.scenario.objects),
            self.settings,
            gate,
            Clocks(time.monotonic, self._system_time),
            self._on_frame,
            self._diagnostics.refuse,
            Crowding(self.scenario).impossible,
        )
        hosts = {
            r: RobotHost(self, r, s, self.settings.command_rate) for r, s in self._specs.items()
        }
        self._drivers = {r: make_robot_driver(host, lab.robots[r]) for r, host in hosts.items()}
        self.fleet = Fleet(self._specs, self._drivers, self.settings, time.monotonic, self._heading)
        self._intake = CommandIntake(self, self._names, self._diagnostics, lambda stamp, rows: None)
        limit = self.settings.command_timeout
        self._intake.connect(self.fleet, self._specs, limit, limit)
        taken = {self._names.world(n) for n in ("poses", "map", "scenario", "cmd_vels")}
        markers = tuple(self.poses.mapping.bodies)
        self._source = make_pose_driver(PoseHost(self, self.poses, markers, taken), lab.poses)
        addresses = [(r.host, r.port) for r in lab.robots.values() if isinstance(r, EPuck2Link)]
        self._guard = Guard(addresses) if addresses else None
        self._pause(True)
        calls = Services(
            self, self._names.world(CALLS), lambda: self._pose_clock.read(time.monotonic())
        )
        calls.serve(SetBool, self._names.world("bridge/pause"), self._on_pause)
        self._timer = self.create_timer(
            self.settings.tick, self._on_tick, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def _make_outputs(self, lab: LabSettings) -> None:
        name, make = self._names.world, self.create_publisher
        events = self._diagnostics.publisher_events(name("poses"))
        self._poses_out = make(Poses, name("poses"), STREAM, event_callbacks=events)
        self._diagnostics.watch_publishers(name("poses"))
        # transforms that come in on a topic do not go out on it
        from_tf = isinstance(lab.poses, TransformSource)
        self._tf = None if from_tf else make(TFMessage, name("tf"), STATUS)
        self._latched = {
            topic: make(kind, name(topic), LATCHED)
            for topic, kind in (
                ("map", OccupancyGrid),
                ("scenario", String),
                ("paused", Bool),
                ("lockstep", Bool),
                ("world_run", String),
            )
        }
        self._latched["scenario"].publish(String(data=self.scenario.text))
        self._latched["map"].publish(grid_to_ros(self.scenario.grid, 0.0))
        self._latched["lockstep"].publish(Bool(data=False))
        self._latched["world_run"].publish(String(data=f"{os.getpid()}.1"))
        if lab.latency is None:
            return
        self._belief = make(BeliefMessage, name("belief"), BELIEF)
        low, high = lab.latency - lab.latency_spread, lab.latency + lab.latency_spread
        believed = Interval(lab.latency, max(0.0, low), min(1.0, high))
        self._belief.publish(belief_to_ros(_SOURCE, {(POSES, "latency"): believed}))

    def _system_time(self) -> float:
        return 1e-9 * float(self.get_clock().now().nanoseconds)

    def _heading(self, robot: str) -> float | None:
        pose = self.poses.gate.pose(robot)
        return None if pose is None else float(pose[2])

    # Poses in

    def _on_frame(self, stamp: float, poses: Mapping[str, Array], verdict: Stamp) -> None:
        now = time.monotonic()
        if verdict is Stamp.RESET:
            self.get_logger().warning("the stamps of the poses went back; all robots are stopped")
            self.fleet.stop_all()
            self._intake.restart()
        self._pose_clock.set(stamp, now)
        self._intake.now = stamp
        if self._paused:
            return  # as in a simulation, no frame comes while the world is paused
        table = np.array(list(poses.values()), dtype=np.float64).reshape(-1, 3)
        self._poses_out.publish(frame_to_ros(list(poses), table, stamp))
        if self._tf is not None and now >= self._next_tf and self._tf.get_subscription_count():
            self._next_tf = now + 1.0 / self.settings.tf_rate
            transforms = [transform_to_ros(n, p, stamp) for n, p in poses.items()]
            self._tf.publish(TFMessage(transforms=transforms))

    # Limits in time

    def _on_tick(self) -> None:
        self.poses.poll()
        lost, back = self.fleet.poll()
        for robot, why in lost.items():
            self.get_logger().warning(f"{robot}: {why}; it is not commanded")
            self._intake.stop(self._intake.gate.rows([robot]))
        for robot in back:
            self.get_logger().info(f"{robot}: connected")
        self._pause(self._paused_by_hand or self._waits_for_robots())
        now = time.monotonic()
        self._intake.now = self._pose_clock.read(now)
        for row in self._intake.watch(self._intake.now):
            self.get_logger().warning(f"{self._intake.gate.names[row]}: no fresh command, stopped")
        if self._pose_clock.silence(now) > self.settings.pose_timeout:
            driving = np.flatnonzero(self._intake.gate.driving)
            if driving.size:
                self.get_logger().warning("no poses from motion capture; all robots are stopped")
                self._intake.stop(driving)

    def _waits_for_robots(self) -> bool:
        return self.settings.pause_when_lost and bool(self.fleet.troubles)

    def _pause(self, paused: bool) -> None:
        """Hold all robots, and tell the nodes; or let them go on."""
        if paused == self._paused:
            return
        self._paused = self.fleet.held = paused
        if paused:
            self.fleet.stop_all()
            self._intake.gate.stop(np.arange(len(self._intake.gate.names)))
        self._latched["paused"].publish(Bool(data=paused))

    def _on_pause(self, request: Any, response: Any) -> Any:
        self._paused_by_hand = bool(request.data)
        self._pause(self._paused_by_hand or self._waits_for_robots())
        response.success = True
        response.message = "paused" if self._paused else "running"
        if self._paused and not self._paused_by_hand:
            response.success, response.message = False, f"paused: {self._trouble()}"
        return response

    def _trouble(self) -> str:
        return "; ".join(f"{robot}: {why}" for robot, why in self.fleet.troubles.items())

    def _state(self) -> dict[str, Any]:
        mean, spread = self.poses.figures.age
        silent = self._pose_clock.silence(time.monotonic()) > self.settings.pose_timeout
        missing = ", ".join(self.poses.missing)
        warning = f"bodies without a pose: {missing}" if missing else ""
        return {
            "scenario": self.scenario.name,
            "on": "lab",
            "paused": bool(self._paused),
            "pose source": ", ".join(self._source.sources),
            "pose rate (Hz)": f"{0.0 if silent else self.poses.figures.rate:.1f}",
            "pose age (ms)": f"{1e3 * mean:.1f} ± {1e3 * spread:.1f}",
            "poses refused": self.poses.gate.refused,
            "pose jumps": self.poses.gate.jumps,
            "unknown bodies": ", ".join(sorted(self.poses.unknown)),
            "missing bodies": missing,
            **{f"robot {r}": d.trouble or "connected" for r, d in self._drivers.items()},
            "warning": self._trouble() or ("no poses arrive" if silent else warning),
        }

    def stop(self) -> None:
        """Last act of a live process: all robots stand."""
        if not self._stopped:
            self._stopped = True
            self.fleet.close(time.sleep)
        if self._guard is not None:
            if left := self._guard.release(self._drivers):
                self.get_logger().error(left)
            self._guard = None

    def destroy_node(self) -> None:
        """Stop the robots, and give the world free."""
        if hasattr(self, "fleet"):
            self.stop()
        if getattr(self, "_claim", None) is not None:
            self._claim.close()  # type: ignore[union-attr]
            self._claim = None
        super().destroy_node()


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(partial(LabBridgeNode), urgency=Urgency.WORLD)


if __name__ == "__main__":
    sys.exit(main())
