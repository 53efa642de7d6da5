"""A lab without hardware, part one: e-puck2 robots that push an object on a table.

Each robot is a TCP server that speaks as the maker's WiFi firmware does. It takes one client at a
time. Every 10 ms it reads commands of 21 bytes, obeys the newest one a little later, and answers
with one byte. When its client goes, it keeps its last speeds. A part of the commands is lost.

The motion is computed by the planar world of this project, which serves as physics only. What can
be seen of the table is sent as UDP datagrams, in place of light, to ``fake_motion_capture.py``.
The suite knows neither of the two programs: it finds TCP servers and a motion-capture topic.

    python examples/lab/fake_robots.py examples/lab/lab-single.yaml --port 10001
"""

import argparse
import json
import random
import signal
import socket
import struct
import time
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from push_scenario.scenario import load_scenario
from sim_bridge.planar_world import PlanarSettings, PlanarWorld

STEP = 0.005  # [s] of this program
PHYSICS = 0.001  # [s]
LOOP = 0.010  # [s] of the firmware
STEPS_PER_TURN = 1000.0
MOST = 1100  # [steps/s]
LENGTH = 21


@dataclass
class Robot:
    """The firmware of one robot."""

    name: str
    server: socket.socket
    wheel_radius: float
    half_track: float
    client: socket.socket | None = None
    data: bytes = b""
    greeted: bool = False
    speeds: tuple[int, int] = (0, 0)
    coming: deque[tuple[float, tuple[int, int]]] = field(default_factory=deque)
    deaf: bool = False
    """Whether it takes no client and answers nothing: a fault that a test injects."""
    reversed: bool = False
    """Whether its motors are connected the wrong way round: likewise."""

    def loop(
        self, now: float, lost: float, delays: tuple[float, float], luck: random.Random
    ) -> None:
        """One turn of the firmware at a time now [s]."""
        if self.deaf:
            return
        if self.client is None:
            try:
                self.client, _ = self.server.accept()
                self.client.setblocking(False)
                self.data, self.greeted = b"", False
            except BlockingIOError:
                return
        gone = False
        try:
            while piece := self.client.recv(4096):
                self.data += piece
            gone = True
        except BlockingIOError:
            pass
        except OSError:
            gone = True
        packets = len(self.data) // LENGTH
        if packets:
            last = self.data[(packets - 1) * LENGTH : packets * LENGTH]
            self.data = self.data[packets * LENGTH :]
            if last[0] == 0x80 and luck.random() >= lost:
                self.greeted = True
                left, right = struct.unpack_from("<hh", last, 3)
                self.coming.append((now + luck.uniform(*delays), (left, right)))
        if gone:
            self.leave()
        elif self.greeted:
            try:
                self.client.send(b"\x03")
            except OSError:
                self.leave()

    def leave(self) -> None:
        """Wait for the next client; the motors go on."""
        if self.client is not None:
            self.client.close()
        self.client = None

    def twist(self, now: float) -> tuple[float, float]:
        """(v, omega) [m/s, rad/s] at a time now [s]."""
        while self.coming and self.coming[0][0] <= now:
            self.speeds = self.coming.popleft()[1]
        sign = -1.0 if self.reversed else 1.0
        left, right = (
            sign * max(-MOST, min(MOST, s)) * 2.0 * np.pi / STEPS_PER_TURN * self.wheel_radius
            for s in self.speeds
        )
        return (left + right) / 2.0, (right - left) / (2.0 * self.half_track)


def listen(port: int) -> socket.socket:
    """A server on this machine."""
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    made.bind(("127.0.0.1", port))
    made.listen(1)
    made.setblocking(False)
    return made


def main() -> None:
    """Run until a signal."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", help="file with the table, its robots and its objects")
    parser.add_argument("--port", type=int, default=10001, help="of the first robot")
    parser.add_argument("--light", type=int, default=10000, help="UDP port of the cameras")
    parser.add_argument("--lost", type=float, default=0.01, help="part of the commands")
    parser.add_argument("--delay", type=float, nargs=2, default=(0.002, 0.012), help="[s]")
    parser.add_argument("--deaf", default="", help="robot that answers nothing")
    parser.add_argument("--reversed", default="", help="robot whose motors run backwards")
    parser.add_argument("--seed", type=int, default=1)
    words = parser.parse_args()
    scenario = load_scenario(words.scenario)
    bodies = (scenario.robots, scenario.objects)
    world = PlanarWorld(scenario.environment, *bodies, PlanarSettings(time_step=PHYSICS))
    robots = []
    for i, (name, (spec, _)) in enumerate(scenario.robots.items()):
        drive = spec.differential
        made = Robot(name, listen(words.port + i), drive.wheel_radius, drive.half_track)
        made.deaf, made.reversed = name == words.deaf, name == words.reversed
        robots.append(made)
    luck = random.Random(words.seed)
    light = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    open_for_work = [True]
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: open_for_work.clear())
    print(f"{len(robots)} robots from port {words.port} on", flush=True)
    tick, start = 0, time.monotonic()
    while open_for_work:
        now = time.monotonic()
        if now < start + tick * STEP:
            time.sleep(start + tick * STEP - now)
            continue
        if now - (start + tick * STEP) > 0.1:  # this process has been held up
            start = now - tick * STEP
        tick += 1
        for robot in robots:
            if tick % round(LOOP / STEP) == 0:
                robot.loop(now, words.lost, tuple(words.delay), luck)
            world.command(robot.name, *robot.twist(now))
        world.step(round(STEP / PHYSICS), contacts=False)
        poses = {n: [float(v) for v in p] for n, p in world.poses().items()}
        packet = {"time": time.time(), "poses": poses}
        light.sendto(json.dumps(packet).encode(), ("127.0.0.1", words.light))


if __name__ == "__main__":
    main()
