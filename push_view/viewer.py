"""A live view in a browser: the map, the bodies, the plan, the supervisor; goals by mouse.

The viewer is a ROS node like any other: it sees poses, map, plan and states, sends goals on
/goal_pose, and knows neither the bridge nor the ground truth. The page is served on this machine
only, unless told otherwise.
"""

import contextlib
import json
import math
import queue
import threading
import time
from collections.abc import Callable
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid as GridMessage
from nav_msgs.msg import Path as PathMessage
from PIL import Image
from rclpy.node import Node
from std_srvs.srv import Trigger

from push_model.occupancy import OccupancyGrid
from push_msgs.msg import ControllerStatus, JobState, Poses
from push_ros.conversions import (
    grid_from_ros,
    pose_stamped_to_ros,
    poses_from_ros,
    time_from_ros,
)
from push_ros.names import names_of
from push_ros.qos import COMMAND, LATCHED, STATUS, STREAM
from push_ros.validation import InvalidMessage, planar_pose
from push_scenario.scenario import Scenario
from push_view.report import outlines_of

_PERIOD = 0.05  # [s] between events to a page
_LONGEST = 10_000  # [bytes] of a request
_LOG = 60  # states kept


class ViewerNode(Node):
    """Keeps what a page shows. ``snapshot`` may be called from any thread."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__("viewer")
        names = names_of(self)
        self._lock = threading.Lock()
        self._requests: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._outlines = {
            name: {"outline": outline.tolist(), "color": color}
            for name, (outline, color) in outlines_of(scenario).items()
        }
        self._item = next(iter(scenario.objects), "")
        self._grid: OccupancyGrid | None = None
        self._view: dict[str, Any] = {"poses": {}, "path": [], "log": [], "map": 0}
        self._goal_publisher = self.create_publisher(PoseStamped, names.team("goal_pose"), COMMAND)
        self._cancel_client = self.create_client(Trigger, names.team("cancel"))
        self.create_subscription(Poses, names.world("poses"), self._on_poses, STREAM)
        self.create_subscription(GridMessage, names.world("map"), self._on_map, LATCHED)
        self.create_subscription(PathMessage, names.team("push_path"), self._on_path, LATCHED)
        self.create_subscription(JobState, names.team("job_state"), self._on_state, LATCHED)
        for robot in scenario.robots:
            topic = names.robot(robot, "controller/status")
            self.create_subscription(ControllerStatus, topic, self._on_status, STATUS)
        self.create_timer(_PERIOD, self._work)

    def _on_poses(self, message: Poses) -> None:
        try:
            known, _ = poses_from_ros(message, self._outlines)
        except InvalidMessage:
            return
        poses = {name: pose.tolist() for name, pose in known.items()}
        with self._lock:
            self._view["poses"].update(poses)
            self._view["time"] = time_from_ros(message.header.stamp)

    def _on_map(self, message: GridMessage) -> None:
        try:
            grid = grid_from_ros(message)
        except InvalidMessage as error:
            self.get_logger().warning(f"refused a map: {error}")
            return
        with self._lock:
            self._grid = grid
            self._view["map"] += 1
            self._view["extent"] = grid.extent

    def _on_path(self, message: PathMessage) -> None:
        points = [[p.pose.position.x, p.pose.position.y] for p in message.poses]
        with self._lock:
            self._view["path"] = points if np.isfinite(points).all() else []

    def _on_state(self, message: JobState) -> None:
        goal = None
        if message.goal.header.frame_id:
            with contextlib.suppress(InvalidMessage):
                goal = planar_pose(message.goal.pose, "the goal").tolist()
        stamp = time_from_ros(message.header.stamp)
        with self._lock:
            self._view["goal"] = goal
            self._view["state"] = message.state_name
            self._view["reason"] = message.reason
            self._view["error_code"] = int(message.error_code)
            self._view["push"] = [int(message.step_index) + 1, int(message.step_count)]
            log = self._view["log"]
            log.append([stamp, message.state_name, message.reason])
            del log[:-_LOG]

    def _on_status(self, message: ControllerStatus) -> None:
        values = {
            "v": message.v,
            "omega": message.omega,
            "error": math.hypot(message.error_x, message.error_y),
            "curvature_margin": message.curvature_margin,
            "obstacle_margin": message.obstacle_margin,
            "solve_time": message.solve_time,
            "failures": int(message.failures),
        }
        with self._lock:
            self._view["controller"] = {
                k: v if math.isfinite(v) else None for k, v in values.items()
            }

    def _work(self) -> None:
        """Carry out what pages asked for, in the executor's thread."""
        while not self._requests.empty():
            self._requests.get()()

    def snapshot(self) -> bytes:
        """What a page shows now, as JSON."""
        with self._lock:
            return json.dumps({**self._view, "item": self._item}, allow_nan=False).encode()

    def bodies(self) -> bytes:
        """Outlines [m] and colours by name, as JSON."""
        return json.dumps(self._outlines).encode()

    def map_image(self) -> bytes | None:
        """The map as a PNG, the first row on top; None while there is none."""
        with self._lock:
            grid = self._grid
        if grid is None:
            return None
        data = BytesIO()
        pixels = np.where(grid.occupied[::-1], 60, 255).astype(np.uint8)
        Image.fromarray(pixels).save(data, "png")
        return data.getvalue()

    def send_goal(self, x: float, y: float, theta: float) -> None:
        """Ask for a goal pose [m, m, rad]; from any thread."""
        message = pose_stamped_to_ros(np.array([x, y, theta]), 0.0)
        self._requests.put(lambda: self._goal_publisher.publish(message))

    def cancel(self) -> None:
        """Ask the supervisor to cancel; from any thread."""
        self._requests.put(lambda: self._cancel_client.call_async(Trigger.Request()))


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def __init__(
        self, node: ViewerNode, stopping: threading.Event, hosts: set[str], *arguments: Any
    ) -> None:
        self._node = node
        self._stopping = stopping
        self._hosts = hosts
        super().__init__(*arguments)

    def log_message(self, *_: Any) -> None:
        """Say nothing of each request."""

    def do_GET(self) -> None:
        """Page, bodies, map, events."""
        path = self.path.split("?")[0]
        if path == "/":
            page = Path(__file__).with_name("viewer.html").read_bytes()
            self._answer(200, "text/html; charset=utf-8", page)
        elif path == "/bodies":
            self._answer(200, "application/json", self._node.bodies())
        elif path == "/map.png":
            image = self._node.map_image()
            if image is None:
                self._answer(404, "text/plain", b"no map yet\n")
            else:
                self._answer(200, "image/png", image)
        elif path == "/events":
            self._stream()
        else:
            self._answer(404, "text/plain", b"not here\n")

    def do_POST(self) -> None:
        """A goal, or cancel; only from the page itself, not from one of another site."""
        length = self.headers.get("Content-Length", "")
        if not (self._from_here() and length.isdigit() and int(length) <= _LONGEST):
            # what follows on this connection is not read, least of all as a request
            self.close_connection = True
            self._answer(403, "text/plain", b"only from the page itself\n")
            return
        body = self.rfile.read(int(length))
        if self.path == "/cancel":
            self._node.cancel()
            self._answer(202, "text/plain", b"asked\n")
        elif self.path == "/goal":
            try:
                values = json.loads(body)
                x, y, theta = (float(values[k]) for k in ("x", "y", "theta"))
                if not all(math.isfinite(v) for v in (x, y, theta)):
                    raise ValueError("not finite")
            except (ValueError, KeyError, TypeError) as error:
                text = f"expected x, y, theta: {type(error).__name__} {error}\n"
                self._answer(400, "text/plain", text.encode())
                return
            self._node.send_goal(x, y, theta)
            self._answer(202, "text/plain", b"sent\n")
        else:
            self._answer(404, "text/plain", b"not here\n")

    def _from_here(self) -> bool:
        """Whether the page that asks was served here: its JSON is announced as such, which other
        sites cannot do unasked, and the host is one that this server goes by."""
        host = self.headers.get("Host", "").rsplit(":", 1)[0]
        origin = self.headers.get("Origin", f"http://{self.headers.get('Host')}")
        return (
            self.headers.get("Content-Type") == "application/json"
            and host in self._hosts
            and origin == f"http://{self.headers.get('Host')}"
        )

    def _answer(self, code: int, kind: str, body: bytes) -> None:
        self.send_response(code)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def _stream(self) -> None:
        """Server-sent events, only when something changed."""
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        before = b""
        try:
            while not self._stopping.is_set():
                now = self._node.snapshot()
                if now != before:
                    self.wfile.write(b"data: " + now + b"\n\n")
                    self.wfile.flush()
                    before = now
                time.sleep(_PERIOD)
        except OSError:
            pass  # the page was closed
        self.close_connection = True


class ViewerServer:
    """Serves a viewer node's page from a thread. port 0 chooses a free one."""

    def __init__(self, node: ViewerNode, host: str, port: int) -> None:
        self._stopping = threading.Event()
        hosts = {"127.0.0.1", "localhost", "[::1]", host}
        handler = partial(_Handler, node, self._stopping, hosts)
        self._server = ThreadingHTTPServer((host, port), handler)
        self._server.daemon_threads = True
        self.port = int(self._server.server_address[1])
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        self._stopping.set()
        self._server.shutdown()
        self._server.server_close()
