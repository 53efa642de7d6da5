"""From poses to command across processes at 100 Hz, the controller following a trajectory."""

import time
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.action import ActionClient
from rclpy.signals import SignalHandlerOptions

from benchmarks.measure import at_most
from push_bringup.launcher import Child, Launcher
from push_bringup.node_kinds import MODULES
from push_bringup.systems import single
from push_model import line, unicycle_step
from push_msgs.action import FollowTrajectory
from push_msgs.msg import Poses
from push_ros.claims import claim_domain
from push_ros.conversions import poses_to_ros, trajectory_to_ros
from push_ros.process import Spinner, prepare_environment
from push_ros.qos import COMMAND, STREAM
from push_scenario.scenario import load_scenario


def run(seconds: float = 15.0) -> dict[str, Any]:
    """Wall time from publishing a frame to receiving its command."""
    claim_domain()
    prepare_environment()
    controller = next(n for n in single(load_scenario("short")) if n.kind == "controller")
    words = controller.words("short")
    launcher = Launcher([Child("controller", MODULES["controller"], words)])
    launcher.start()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("latency")
    spinner = Spinner([node])
    sent: dict[int, float] = {}
    delays: list[float] = []
    state = {"robot": np.array([-1.3, 0.0, 0.0])}

    def on_command(message: TwistStamped) -> None:
        tick = round(message.header.stamp.sec * 100 + message.header.stamp.nanosec / 1e7)
        if tick in sent:
            delays.append(time.perf_counter() - sent.pop(tick))
        state["robot"] = unicycle_step(
            state["robot"], message.twist.linear.x, message.twist.angular.z, 0.01
        )

    publisher = node.create_publisher(Poses, "/poses", STREAM)
    aside = np.array([1.4, 0.8, 0.0])
    node.create_subscription(TwistStamped, "/epuck1/cmd_vel", on_command, COMMAND)
    client = ActionClient(node, FollowTrajectory, "/epuck1/follow_trajectory")
    try:
        if not spinner.until(
            lambda: client.server_is_ready() and publisher.get_subscription_count() > 0, 30.0
        ):
            raise RuntimeError("the controller did not come up")
        trajectory = trajectory_to_ros(line(state["robot"], 2.6, 0.1, 0.1))
        client.send_goal_async(FollowTrajectory.Goal(trajectory=trajectory))
        end, tick = time.perf_counter() + seconds, 100
        following = time.perf_counter()
        while time.perf_counter() < end:
            tick += 1
            message = poses_to_ros({"epuck1": state["robot"], "box": aside}, tick / 100)
            sent[tick] = time.perf_counter()
            publisher.publish(message)
            following += 0.01
            while time.perf_counter() < following:
                spinner.once(max(0.0005, following - time.perf_counter()))
    finally:
        spinner.close()
        rclpy.try_shutdown()
        launcher.stop()
    values = 1e3 * np.array(delays[50:])
    p50, p99 = np.percentile(values, [50, 99])
    worst = values.max()
    print(
        f"  {len(values)} answers: median {p50:.2f} ms, p99 {p99:.2f} ms, max {worst:.2f} ms; "
        f"unanswered {len(sent)}"
    )
    return {
        "median_ms": float(p50),
        "p99_ms": float(p99),
        "answers": len(values),
        "bounds": {"p99 [ms]": at_most(p99, 8.0)},
    }
