"""An e-puck2 over TCP. Nothing here blocks: the link is polled.

Commands are acknowledged. A further one is sent only when few are unanswered, so that commands do
not pile up in a slow network, where they would be obeyed late; a stop is sent at once. The last
command is repeated, so that a lost one is made good and a dead link is noticed. After every
connection the first command is a stop.
"""

import contextlib
import errno
import math
import socket
from collections import deque

import numpy as np

from lab_bridge.epuck2_packets import COMMAND_LENGTH, AnswerReader, BadPacket, encode
from lab_bridge.robot_drivers import RobotHost
from lab_bridge.throttle import Throttle
from push_model.arrays import Array
from push_model.settings import SettingsError
from push_scenario.lab import EPuck2Link

_REPEAT = 0.1  # [s]
_UNANSWERED = 3  # commands under way
_FORGIVE = 0.25
"""[s] after which an unanswered command counts as lost. Less than ``_UNANSWERED * _REPEAT``: else
lost answers would hold up further commands for ever, while the last one is repeated and answered.
"""
_PATIENCE = 2.0  # [s] for a connection
_AGAIN = 1.0  # [s] until the next try
_UNDER_WAY = (errno.EINPROGRESS, errno.EALREADY, errno.EWOULDBLOCK, errno.EINTR)


class EPuck2Driver:
    """See RobotDriver."""

    def __init__(self, host: RobotHost, link: EPuck2Link) -> None:
        """Resolve the address; connect at the first poll.

        Raises
        ------
        SettingsError: the robot has no wheels, or its address cannot be resolved.
        """
        drive = host.spec.kinematics
        if drive is None:
            raise SettingsError(f"lab.robots.{host.robot}: an e-puck2 has two wheels")
        self._drive, self._link = drive, link
        self._throttle = Throttle(host.rate)
        try:
            self._address = (socket.gethostbyname(link.host), link.port)
        except OSError as error:
            raise SettingsError(
                f"lab.robots.{host.robot}.host: '{link.host}' cannot be resolved: {error}"
            ) from None
        self._where = f"{link.host}:{link.port}"
        self._socket: socket.socket | None = None
        self._connected = False
        self._next_try = -math.inf
        self._why = f"not connected to {self._where} yet"
        self.connections = 0
        """How often it has been connected."""
        self._moving = False
        self._forget()

    def _forget(self) -> None:
        self._last = np.zeros(2)  # [steps/s] left, right
        self._out = b""
        self._reader = AnswerReader()
        self._unanswered: deque[float] = deque()  # [s] when commands under way were sent
        self._answered = False
        self._sent = self._heard = -math.inf

    @property
    def trouble(self) -> str:
        """See RobotDriver."""
        return "" if self._connected and self._answered else self._why

    @property
    def standing(self) -> bool:
        """Whether no motion was sent, or the robot has answered a stop after the last one."""
        return not self._moving

    def steps(self, twist: Array) -> Array:
        """``(2,)`` motor speeds [steps/s], left and right, whole numbers within the limits; scaled
        by one factor where one would be too great."""
        wheels = np.array(self._drive.wheel_speeds(float(twist[0]), float(twist[2])))
        speeds = wheels * self._link.steps_per_turn / (2.0 * math.pi)
        excess = max(1.0, float(np.abs(speeds).max()) / self._link.max_steps)
        rounded: Array = np.rint(speeds / excess)
        return rounded

    def command(self, twist: Array, now: float) -> None:
        """See RobotDriver."""
        if self.trouble:
            return
        steps = self.steps(twist)
        if not steps.any() or len(self._unanswered) < _UNANSWERED:
            self._put(self._throttle.offer(steps, now), now)
        else:
            self._throttle.hold(steps)

    def poll(self, now: float) -> None:
        """See RobotDriver."""
        if self._socket is None:
            if now >= self._next_try:
                self._begin(now)
            return
        if not self._connected:
            self._finish(now)
            return
        self._receive(now)
        if not self._connected:
            return
        if now - self._heard > self._link.silence:
            self._lose(f"{self._where} has not answered for {self._link.silence:g} s", now)
            return
        while self._unanswered and now - self._unanswered[0] > _FORGIVE:
            self._unanswered.popleft()
        due = self._throttle.due(now) if len(self._unanswered) < _UNANSWERED else None
        if due is None and now - self._sent > _REPEAT:
            due = self._last
        self._put(due, now)
        self._flush(now)

    def _begin(self, now: float) -> None:
        self._socket = made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        made.setblocking(False)
        with contextlib.suppress(OSError):
            made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._next_try = now + _PATIENCE
        self._finish(now)

    def _finish(self, now: float) -> None:
        """Look whether the connection has come about."""
        assert self._socket is not None
        code = self._socket.connect_ex(self._address)
        if code in _UNDER_WAY:
            if now > self._next_try:
                self._lose(f"no connection to {self._where}: no answer", now)
            return
        if code not in (0, errno.EISCONN):
            self._lose(f"no connection to {self._where}: {errno.errorcode.get(code, code)}", now)
            return
        self._forget()
        self._connected = True
        self._heard = now
        self.connections += 1
        self._throttle.clear()
        self._put(np.zeros(2), now)
        self._flush(now)

    def _lose(self, why: str, now: float) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket, self._connected = None, False
        self._why = why
        self._next_try = now + _AGAIN
        self._throttle.clear()
        self._forget()

    def _put(self, steps: Array | None, now: float) -> None:
        """Take a command for sending, in place of one of which no byte has been sent."""
        if steps is None:
            return
        self._last, self._sent = steps, now
        self._moving |= bool(steps.any())
        left, right = (int(s) for s in steps)
        self._out = self._out[: len(self._out) % COMMAND_LENGTH] + encode(left, right)
        self._unanswered.append(now)
        self._flush(now)

    def _flush(self, now: float) -> None:
        if self._socket is None or not self._out:
            return
        try:
            self._out = self._out[self._socket.send(self._out) :]
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(f"the connection to {self._where} is lost: {error.strerror}", now)

    def _receive(self, now: float) -> None:
        assert self._socket is not None
        try:
            while True:
                data = self._socket.recv(4096)
                if not data:
                    self._lose(f"{self._where} has closed the connection", now)
                    return
                answers = self._reader.feed(data)
                for _ in range(min(answers, len(self._unanswered))):
                    self._unanswered.popleft()
                if answers:
                    self._heard, self._answered = now, True
                    if not self._unanswered and not self._last.any():
                        self._moving = False
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(f"the connection to {self._where} is lost: {error.strerror}", now)
        except BadPacket as error:
            self._lose(f"{self._where}: {error}", now)

    def close(self, now: float) -> None:
        """See RobotDriver."""
        if self._socket is None:
            return
        if self._connected:
            with contextlib.suppress(OSError):
                self._socket.settimeout(0.3)
                self._socket.sendall(self._out[: len(self._out) % COMMAND_LENGTH] + encode(0, 0))
                self._socket.shutdown(socket.SHUT_WR)
        self._socket.close()
        self._socket, self._connected = None, False


DRIVER = EPuck2Driver
