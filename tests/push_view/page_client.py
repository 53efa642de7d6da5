"""A browser's side of the viewer without a browser, and a suite's side of ROS."""

import http.client
import json
import threading
import time

import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from push_msgs.msg import JobState, Poses
from push_ros.conversions import poses_to_ros
from push_ros.process import Spinner
from push_ros.qos import COMMAND, LATCHED, STREAM
from push_view.page_server import PageServer
from push_view.viewer_node import ViewerNode


class Suite:
    """Stands on the other side of ROS: a bridge that sends poses, and teams that take goals."""

    def __init__(self, teams=("/",), world="/"):
        self.node = rclpy.create_node("suite")
        self.goals = {team: [] for team in teams}
        self.cancels = dict.fromkeys(teams, 0)
        self.states = {}
        for team in teams:
            self.node.create_subscription(
                PoseStamped, f"{team}goal_pose", self.goals[team].append, COMMAND
            )
            self.node.create_service(
                Trigger, f"{team}cancel", lambda q, r, t=team: self.on_cancel(t, r)
            )
            self.states[team] = self.node.create_publisher(JobState, f"{team}job_state", LATCHED)
        self.poses = self.node.create_publisher(Poses, f"{world}poses", STREAM)
        self.maps = self.node.create_publisher(OccupancyGrid, f"{world}map", LATCHED)
        self.scenarios = self.node.create_publisher(String, f"{world}scenario", LATCHED)
        self.paused = self.node.create_publisher(Bool, f"{world}paused", LATCHED)
        self.time = 1.0
        self.frame = {}
        self.timer = self.node.create_timer(0.05, self.tick)

    def tick(self):
        self.time += 0.05
        self.poses.publish(poses_to_ros(self.frame, self.time))

    def on_cancel(self, team, response):
        self.cancels[team] += 1
        response.success, response.message = True, "canceled"
        return response

    def silent(self):
        """No poses any more; everything else stays in the graph."""
        self.node.destroy_timer(self.timer)


class Page:
    """What a page can do, while ROS goes on."""

    def __init__(self, scenario=None, suite=None, host="127.0.0.1", streams=16):
        self.suite = suite
        self.node = ViewerNode(scenario)
        self.server = PageServer(self.node, host, 0, streams)
        nodes = [self.node] if suite is None else [self.node, suite.node]
        self.spinner = Spinner(nodes)

    def ready(self):
        """Wait until every team takes goals."""
        expected = set(self.suite.goals)
        return self.until(
            lambda: (
                set(self.node.suite()["teams"]) == expected
                and not any(self.node.suite()["teams"].values())
            )
        )

    def until(self, condition, limit=8.0):
        return self.spinner.until(condition, limit)

    def away(self, work):
        """The result of work that is done in a thread, while ROS goes on."""
        result = []
        thread = threading.Thread(target=lambda: result.append(work()))
        thread.start()
        assert self.until(lambda: not thread.is_alive(), 60.0)
        return result[0]

    def ask(self, method, path, body=None, headers=None):
        """Status, type and body of an answer."""

        def work():
            connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=5)
            given = {"Content-Type": "application/json"} if method == "POST" else {}
            given.update(headers or {})
            body_ = (body or "") if method == "POST" else None
            connection.request(method, path, body_, given)
            answer = connection.getresponse()
            stream = path == "/events" and answer.status == 200
            data = answer.readline() if stream else answer.read()
            connection.close()
            return answer.status, answer.getheader("Content-Type"), data

        return self.away(work)

    def send(self, **values):
        status, _, data = self.ask("POST", "/goal", json.dumps(values))
        return status, data

    def events(self, enough, limit=8.0):
        """Newest data by kind (of a team: by kind and space) of a new stream, when it is enough."""

        def work():
            connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=limit)
            connection.request("GET", "/events")
            answer = connection.getresponse()
            assert (answer.status, answer.getheader("Content-Type")) == (200, "text/event-stream")
            seen, end = {}, time.monotonic() + limit
            while not enough(seen):
                assert time.monotonic() < end, f"not enough came: {seen}"
                kind = answer.readline().decode().removeprefix("event: ").strip()
                data = json.loads(answer.readline().decode().removeprefix("data: "))
                assert answer.readline() == b"\n"
                seen[(kind, data["space"]) if "space" in data else kind] = data
            connection.close()
            return seen

        return self.away(work)

    def close(self):
        self.server.close()
        self.spinner.close()
