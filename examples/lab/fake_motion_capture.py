"""A lab without hardware, part two: a motion-capture driver.

It publishes what such a driver publishes, and nothing else: poses in millimetres, y upwards, under
names of its own, of marker frames that sit somewhere on the bodies; 120 times a second, 15 to 30 ms
late, with 1 % of the poses lost. It imports nothing of this project. What it sees comes from
``fake_robots.py`` by UDP, in place of light.

    python examples/lab/fake_motion_capture.py --bodies '{"epuck1": ["Robot 1", 0.01, 0, 0.3]}'
"""

import argparse
import heapq
import json
import math
import random
import signal
import socket
import time
from typing import Any

import rclpy
from geometry_msgs.msg import Pose, PoseArray, PoseStamped, TransformStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy

RATE = 120.0  # [Hz]
LATE = (0.015, 0.030)  # [s]
LOST = 0.01
NOISE = (0.1e-3, 0.0005)  # [m, rad]
UNIT = 1000.0  # millimetres in a metre


def marker_pose(pose: list[float], offset: list[float], unit: float, y_up: bool) -> Pose:
    """Pose of a marker frame at an offset [m, m, rad] on a body at a pose [m, m, rad]."""
    x, y, yaw = pose
    c, s = math.cos(yaw), math.sin(yaw)
    x, y = x + c * offset[0] - s * offset[1], y + s * offset[0] + c * offset[1]
    yaw += offset[2]
    made = Pose()
    z, half = 0.05, 0.5 * yaw
    if y_up:  # x stays, z becomes y, y becomes -z
        made.position.x, made.position.y, made.position.z = unit * x, unit * z, -unit * y
        made.orientation.y = math.sin(half)
    else:
        made.position.x, made.position.y, made.position.z = unit * x, unit * y, unit * z
        made.orientation.z = math.sin(half)
    made.orientation.w = math.cos(half)
    return made


def main() -> None:
    """Run until a signal."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--bodies", required=True, help="JSON: body to [name, x, y, yaw] of markers"
    )
    parser.add_argument("--light", type=int, default=10000, help="UDP port of the cameras")
    parser.add_argument(
        "--type", choices=("pose_stamped", "pose_array", "tf"), default="pose_stamped"
    )
    parser.add_argument("--topic", default="/vrpn/{name}/pose")
    parser.add_argument("--metres", action="store_true", help="metres instead of millimetres")
    parser.add_argument("--z-up", action="store_true", help="z upwards instead of y")
    parser.add_argument("--stale-clock", action="store_true", help="all stamps are the first one")
    parser.add_argument("--blind", action="store_true", help="publish nothing")
    parser.add_argument("--seed", type=int, default=1)
    words = parser.parse_args()
    bodies = {name: (entry[0], entry[1:]) for name, entry in json.loads(words.bodies).items()}
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    node = rclpy.create_node("motion_capture")
    qos = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    if words.type == "pose_stamped":
        names = {
            marker: words.topic.replace("{name}", marker.replace(" ", "_"))
            for marker, _ in bodies.values()
        }
        outputs = {m: node.create_publisher(PoseStamped, t, qos) for m, t in names.items()}
    elif words.type == "pose_array":
        output = node.create_publisher(PoseArray, words.topic, qos)
    else:
        from tf2_msgs.msg import TFMessage

        output = node.create_publisher(TFMessage, words.topic, QoSProfile(depth=50))
    luck = random.Random(words.seed)
    light = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    light.bind(("127.0.0.1", words.light))
    light.setblocking(False)
    unit = 1.0 if words.metres else UNIT
    first: list[float] = []

    def publish(seen: dict[str, Any]) -> None:
        instant = first[0] if words.stale_clock and first else seen["time"]
        first.append(instant)
        stamp = rclpy.time.Time(nanoseconds=round(1e9 * instant)).to_msg()
        made: dict[str, Pose] = {}
        for body, (marker, offset) in bodies.items():
            if body not in seen["poses"] or luck.random() < LOST:
                continue
            x, y, yaw = seen["poses"][body]
            noisy = [luck.gauss(x, NOISE[0]), luck.gauss(y, NOISE[0]), luck.gauss(yaw, NOISE[1])]
            made[marker] = marker_pose(noisy, offset, unit, not words.z_up)
        if words.type == "pose_array":
            if len(made) == len(bodies):  # a driver cannot leave one out
                message = PoseArray(poses=list(made.values()))
                message.header.stamp = stamp
                output.publish(message)
        elif words.type == "tf":
            transforms = []
            for marker, pose in made.items():
                t = TransformStamped(child_frame_id=marker)
                t.header.stamp, t.header.frame_id = stamp, "mocap"
                p = pose.position
                t.transform.translation.x, t.transform.translation.y = p.x, p.y
                t.transform.translation.z, t.transform.rotation = p.z, pose.orientation
                transforms.append(t)
            output.publish(TFMessage(transforms=transforms))
        else:
            for marker, pose in made.items():
                single = PoseStamped(pose=pose)
                single.header.stamp, single.header.frame_id = stamp, "mocap"
                outputs[marker].publish(single)

    open_for_work = [True]
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: open_for_work.clear())
    waiting: list[tuple[float, int, dict[str, Any]]] = []
    newest: dict[str, Any] | None = None
    shot, last, count, seen_at = time.monotonic(), 0.0, 0, 0.0
    while open_for_work:
        try:
            while True:
                newest = json.loads(light.recv(65536))
        except BlockingIOError:
            pass
        now = time.monotonic()
        if now >= shot:
            shot = max(shot + 1.0 / RATE, now - 0.1)
            if newest is not None and newest["time"] > seen_at and not words.blind:
                seen_at = newest["time"]
                last = max(last, now + luck.uniform(*LATE))  # frames keep their order
                count += 1
                heapq.heappush(waiting, (last, count, newest))
        while waiting and waiting[0][0] <= now:
            publish(heapq.heappop(waiting)[2])
        time.sleep(0.001)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
