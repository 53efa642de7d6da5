"""The ROS node of the viewer: data for the pages, and the goals that they send.

The node subscribes to poses, map, plans and jobs of all teams in its world's namespace, and sends
goals. It knows neither the bridge nor the ground truth. It learns the bodies from the latched topic
``scenario``.
"""

import queue
import threading
import time
from collections.abc import Callable
from functools import partial
from io import BytesIO
from typing import Any

import numpy as np
from nav_msgs.msg import OccupancyGrid as GridMessage
from PIL import Image
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import Bool, String

from push_model.occupancy import OccupancyGrid
from push_model.settings import SettingsError
from push_msgs.msg import Belief as BeliefMessage
from push_msgs.msg import Poses
from push_ros.conversions import grid_from_ros
from push_ros.names import Names, names_of
from push_ros.qos import BELIEF, LATCHED, STREAM
from push_ros.validation import InvalidMessage
from push_scenario.scenario import Scenario, scenario_from_text
from push_view.belief_table import BeliefTable
from push_view.bodies import bodies_of
from push_view.event_board import EventBoard
from push_view.page_data import obstacles_json
from push_view.pose_table import PoseTable
from push_view.suite_watch import SuiteWatch
from push_view.team_spaces import team_spaces
from push_view.team_view import TeamView, stamp_text
from push_view.world_controls import Answer, WorldControls

PERIOD = 0.05
"""[s] between two frames that are sent to pages."""
_LOOK = 0.25  # [s] between two checks of the graph
_SEARCH = 1.0  # [s] between two searches for teams
_OCCUPIED = 110  # grey
_ANSWER = 3.0  # [s] that a request is waited for


class NotTaken(Exception):
    """A request that is not passed on, or that a node refused; the text says why."""


class ViewerNode(Node):
    """Keeps ``board`` up to date. Methods without an underscore may be called from any thread."""

    def __init__(self, scenario: Scenario | None = None) -> None:
        """scenario: if known beforehand; one on the topic replaces it."""
        super().__init__("viewer")
        self.names = names_of(self)
        self.board = EventBoard()
        self._lock = threading.Lock()
        self._requests: queue.SimpleQueue[tuple[Callable[[], None], Answer]] = queue.SimpleQueue()
        self._teams: dict[str, TeamView] = {}
        self._grid: OccupancyGrid | None = None
        self._maps = 0
        self._table: PoseTable | None = None
        self._revision = 0
        self._frame: bytes | None = None
        self._belief: BeliefTable | None = None
        self._controls = WorldControls(self, self.names)
        self._last_stamp = 0
        self._offered: list[str] = []
        self._watch = SuiteWatch(self.names.world("poses"), time.monotonic())
        if scenario is not None:
            self._show(scenario)
        world = self.names.world
        self.create_subscription(Poses, world("poses"), self._on_poses, STREAM, raw=True)
        self.create_subscription(GridMessage, world("map"), self._on_map, LATCHED)
        self.create_subscription(String, world("scenario"), self._on_scenario, LATCHED)
        self.create_subscription(Bool, world("paused"), self._on_paused, LATCHED)
        self.create_subscription(BeliefMessage, world("belief"), self._on_belief, BELIEF)
        wall = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(PERIOD, self._work, clock=wall)
        self.create_timer(_LOOK, self._look, clock=wall)
        self.create_timer(_SEARCH, self._search, clock=wall)
        self._search()

    def suite(self) -> dict[str, Any]:
        """Problems of the suite, in a sentence or empty; and of each team."""
        trouble = self._watch.trouble(time.monotonic())
        with self._lock:
            teams = list(self._teams.values())
        return {
            "trouble": trouble,
            "paused": self._watch.paused,
            "offered": self._offered,
            "teams": {t.space: trouble or self._deaf(t) for t in teams},
        }

    def map_image(self) -> bytes | None:
        """The map as a PNG, the first row on top, free cells transparent; None if there is none."""
        with self._lock:
            grid = self._grid
        if grid is None:
            return None
        data = BytesIO()
        pixels = np.zeros((*grid.occupied.shape, 2), dtype=np.uint8)  # grey, opacity
        pixels[grid.occupied[::-1]] = _OCCUPIED, 255
        Image.fromarray(pixels, "LA").save(data, "png")
        return data.getvalue()

    def send_goal(self, space: str, x: float, y: float, theta: float, preview: bool = False) -> str:
        """Ask a team for a goal pose [m, m, rad].

        The goal gets a unique wall-time stamp, which is returned. JobState.goal or
        JobState.refused_goal with that stamp says what became of it. space: of the team; empty:
        the first. preview: plan only, and wait for ``execute``. Raises NotTaken if no node would
        accept it.
        """
        team = self._ready(space)
        with self._lock:
            self._last_stamp = max(time.time_ns(), self._last_stamp + 1)
            message = team.goal_message(np.array([x, y, theta]), self._last_stamp)
        send = partial(team.preview if preview else team.send, message)
        self._requests.put((send, lambda good, text: None))
        return stamp_text(message)

    def cancel(self, space: str) -> str:
        """Ask a team to cancel its job; its answer. Raises NotTaken if there is nothing to
        cancel, or if no node would receive it."""
        return self._wait(self._ready(space).cancel)

    def execute(self, space: str) -> str:
        """Ask a team to carry out the plan that waits; its answer. Raises NotTaken, as above."""
        return self._wait(self._ready(space).execute)

    def control(self, name: str, values: dict[str, Any]) -> str:
        """A request to the world, see ``WorldControls``; its answer. Raises NotTaken."""
        return self._wait(lambda answer: self._controls.ask(name, values, answer))

    def _wait(self, ask: Callable[[Answer], None]) -> str:
        """Ask in the executor's thread, and wait for the answer in this one."""
        answers: queue.SimpleQueue[tuple[bool, str]] = queue.SimpleQueue()

        def answer(good: bool, text: str) -> None:
            answers.put((good, text))

        self._requests.put((lambda: ask(answer), answer))
        try:
            good, text = answers.get(timeout=_ANSWER)
        except queue.Empty:
            raise NotTaken(f"no answer within {_ANSWER:g} s") from None
        if not good:
            raise NotTaken(text)
        return text

    def _ready(self, space: str) -> TeamView:
        with self._lock:
            team = self._teams.get(space) if space else next(iter(self._teams.values()), None)
        trouble = self._watch.trouble(time.monotonic())
        if trouble:
            raise NotTaken(trouble)
        if team is None:
            raise NotTaken(f"there is no team in '{space}'" if space else "there is no team yet")
        if not team.hears:
            raise NotTaken(self._deaf(team))
        return team

    @staticmethod
    def _deaf(team: TeamView) -> str:
        return "" if team.hears else f"no node accepts goals on {team.names.team('goal_pose')}"

    def _show(self, scenario: Scenario) -> None:
        self._revision += 1
        self._table = PoseTable(bodies_of(scenario))
        self._frame = None
        self.board.drop("poses")
        data = {
            "revision": self._revision,
            "obstacles": obstacles_json(scenario.environment),
            **self._table.bodies.as_json(),
        }
        self.board.put("bodies", "bodies", data)
        self._belief = BeliefTable(scenario)
        self._put_belief()

    def _on_scenario(self, message: String) -> None:
        where = self.names.world("scenario")
        try:
            scenario = scenario_from_text(message.data, "scenario", where)
        except SettingsError as error:
            self.get_logger().warning(f"refused a scenario: {error}")
            return
        self._show(scenario)
        for space, team in list(self._teams.items()):  # those of the previous scenario
            if self.count_publishers(team.names.team("job_state")) == 0:
                team.close()
                with self._lock:
                    del self._teams[space]
        self._list_teams()

    def _put_belief(self) -> None:
        if self._belief is not None:
            self.board.put("belief", "belief", {"rows": self._belief.as_json()})

    def _on_belief(self, message: BeliefMessage) -> None:
        if self._belief is None:
            return
        try:
            self._belief.take(message)
        except InvalidMessage as error:
            self.get_logger().warning(f"refused a belief: {error}")
            return
        self._put_belief()

    def _on_poses(self, data: bytes) -> None:
        now = time.monotonic()
        self._watch.poses_came(now)
        for team in self._teams.values():
            team.delay.poses(data, now)
        self._frame = data  # read by _work, at most as often as it is sent to pages

    def _on_paused(self, message: Bool) -> None:
        self._watch.paused = bool(message.data)

    def _on_map(self, message: GridMessage) -> None:
        try:
            grid = grid_from_ros(message)
        except InvalidMessage as error:
            self.get_logger().warning(f"refused a map: {error}")
            return
        with self._lock:
            self._grid = grid
        self._maps += 1
        self.board.put("map", "map", {"number": self._maps, "extent": [*map(float, grid.extent)]})

    def _work(self) -> None:
        """Carry out the requests of pages; send the newest frame."""
        while not self._requests.empty():
            request, answer = self._requests.get()
            try:
                request()
            except Exception as error:
                self.get_logger().error(f"a request of a page was not sent: {error}")
                answer(False, f"not sent: {error}")
        data, self._frame = self._frame, None
        if data is None or self._table is None:
            return
        try:
            self._table.take(deserialize_message(data, Poses))
        except (RuntimeError, RCLError, ValueError) as error:
            self.get_logger().warning(
                f"refused a frame of poses: {error}", throttle_duration_sec=5.0
            )
            return
        self.board.put("poses", "poses", {"revision": self._revision, **self._table.as_json()})

    def _look(self) -> None:
        """Look up in the graph who publishes poses, and who answers requests."""
        self._offered = self._controls.offered()
        self._watch.looked(time.monotonic(), self.count_publishers(self.names.world("poses")))
        for team in self._teams.values():
            team.look()
            team.show_panel()

    def _search(self) -> None:
        """Look up the teams in the graph."""
        topics = self.get_topic_names_and_types()
        found = team_spaces(topics, self.names.world_space, self.names.team_space)
        new = [space for space in found if space not in self._teams]
        for space in new:
            team = TeamView(self, Names(self.names.world_space, space), self.board)
            with self._lock:
                self._teams[space] = team
        if new:
            self._list_teams()

    def _list_teams(self) -> None:
        self.board.put("teams", "teams", {"spaces": list(self._teams)})
