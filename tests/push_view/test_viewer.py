"""The live view: what a page gets, and what it may ask for."""

import http.client
import json
import math
import socket
import threading

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from std_srvs.srv import Trigger

from push_msgs.msg import JobState, Poses
from push_ros.conversions import grid_to_ros, poses_to_ros
from push_ros.process import Spinner
from push_ros.qos import COMMAND, LATCHED, STREAM
from push_view.viewer import ViewerNode, ViewerServer


class Page:
    """A browser's side, the viewer, and a node that stands on the other side of ROS."""

    def __init__(self, scenario):
        self.scenario = scenario
        self.node = ViewerNode(scenario)
        self.server = ViewerServer(self.node, "127.0.0.1", 0)
        self.other = rclpy.create_node("other")
        self.goals, self.cancels = [], []
        self.other.create_subscription(PoseStamped, "/goal_pose", self.goals.append, COMMAND)
        self.other.create_service(Trigger, "/cancel", self.on_cancel)
        self.poses = self.other.create_publisher(Poses, "/poses", STREAM)
        self.maps = self.other.create_publisher(OccupancyGrid, "/map", LATCHED)
        self.states = self.other.create_publisher(JobState, "/job_state", LATCHED)
        self.spinner = Spinner([self.node, self.other])
        assert self.spinner.until(
            lambda: (
                self.poses.get_subscription_count() > 0
                and self.other.count_publishers("/goal_pose") > 0
                and self.node._cancel_client.service_is_ready()
            ),
            5.0,
        )

    def on_cancel(self, request, response):
        self.cancels.append(request)
        return response

    def ask(self, method, path, body=None, headers=None):
        """Status, type and body of an answer, while ROS goes on."""
        result = []

        def run():
            connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=5)
            if method == "POST":
                headers_ = {"Content-Type": "application/json", **(headers or {})}
                connection.request(method, path, body or "", headers_)
            else:
                connection.request(method, path)
            answer = connection.getresponse()
            data = answer.readline() if path == "/events" else answer.read()
            result.append((answer.status, answer.getheader("Content-Type"), data))
            connection.close()

        thread = threading.Thread(target=run)
        thread.start()
        assert self.spinner.until(lambda: not thread.is_alive(), 6.0)
        return result[0]

    def view(self):
        return json.loads(self.ask("GET", "/events")[2].removeprefix(b"data: "))

    def close(self):
        self.server.close()
        self.spinner.close()


@pytest.fixture
def page(ros, scenario):
    page = Page(scenario)
    yield page
    page.close()


def test_page_bodies_and_map(page):
    status, kind, body = page.ask("GET", "/")
    assert status == 200 and kind.startswith("text/html") and b"<canvas" in body
    status, _, body = page.ask("GET", "/bodies")
    assert set(json.loads(body)) == {"epuck1", "box"}
    assert page.ask("GET", "/map.png")[0] == 404
    page.maps.publish(grid_to_ros(page.scenario.grid, 1.0))
    assert page.spinner.until(lambda: page.node.map_image() is not None, 5.0)
    status, kind, body = page.ask("GET", "/map.png")
    assert (status, kind) == (200, "image/png") and body.startswith(b"\x89PNG")
    assert page.view()["extent"] == pytest.approx(page.scenario.grid.extent)
    assert page.ask("GET", "/elsewhere")[0] == 404


def test_events_carry_poses_and_states_and_nothing_that_is_not_json(page):
    places = {"box": np.array([0.5, -0.2, 1.0]), "epuck1": np.array([0.4, math.nan, 1.0])}
    frame = poses_to_ros(places, 3.5)
    page.poses.publish(frame)
    page.states.publish(JobState(state_name="PLANNING", reason="why <b>not</b>"))
    assert page.spinner.until(lambda: b"PLANNING" in page.node.snapshot(), 5.0)
    assert page.spinner.until(lambda: b'"box"' in page.node.snapshot(), 5.0)
    view = page.view()
    assert view["poses"]["box"] == pytest.approx([0.5, -0.2, 1.0])
    assert "epuck1" not in view["poses"]
    assert (view["state"], view["reason"]) == ("PLANNING", "why <b>not</b>")


def test_a_goal_and_a_cancel_of_the_page_reach_ros(page):
    status, _, _ = page.ask("POST", "/goal", json.dumps({"x": 1.0, "y": 0.5, "theta": 0.3}))
    assert status == 202
    assert page.spinner.until(lambda: page.goals, 5.0)
    goal = page.goals[0]
    assert goal.header.frame_id == "map"
    assert (goal.pose.position.x, goal.pose.position.y) == (1.0, 0.5)
    assert page.ask("POST", "/cancel")[0] == 202
    assert page.spinner.until(lambda: page.cancels, 5.0)


@pytest.mark.parametrize(
    "body",
    ["", "{", '{"x": 1}', '{"x": "a", "y": 0, "theta": 0}', '{"x": NaN, "y": 0, "theta": 0}'],
)
def test_a_goal_that_is_none_is_refused(page, body):
    status, _, text = page.ask("POST", "/goal", body)
    assert status == 400 and b"expected x, y, theta" in text
    assert page.goals == []


GOAL = json.dumps({"x": 1.0, "y": 0.5, "theta": 0.3})


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "http://evil.example:8080", "Host": "evil.example:8080"},
        {"Content-Type": "text/plain"},
        {"Content-Length": "many"},
    ],
)
def test_other_sites_cannot_move_the_robot(page, headers):
    """Also where a name of theirs leads here, or where their form is sent without asking."""
    assert page.ask("POST", "/goal", GOAL, headers)[0] == 403
    own = {"Origin": f"http://127.0.0.1:{page.server.port}"}
    assert page.ask("POST", "/goal", GOAL, own)[0] == 202
    assert page.spinner.until(lambda: page.goals, 5.0) and len(page.goals) == 1


def test_the_body_of_a_refused_request_is_not_taken_for_another(page):
    length = f"Content-Length: {len(GOAL)}"
    own = f"Host: 127.0.0.1:{page.server.port}\r\nContent-Type: application/json"
    inner = f"POST /goal HTTP/1.1\r\n{own}\r\n{length}\r\n\r\n{GOAL}"
    outer = (
        f"POST /goal HTTP/1.1\r\nOrigin: http://evil.example\r\n{own}\r\n"
        f"Content-Length: {len(inner)}\r\n\r\n{inner}"
    )
    with socket.create_connection(("127.0.0.1", page.server.port), timeout=5) as connection:
        connection.sendall(outer.encode())
        answers = b""
        while chunk := connection.recv(4096):
            answers += chunk
    assert answers.count(b"HTTP/1.1") == 1 and b"403" in answers
    page.spinner.until(lambda: bool(page.goals), 0.3)
    assert page.goals == []
