"""The link to an e-puck2, over real sockets on this machine; all times are passed in."""

import socket
import struct
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lab_bridge.epuck2_packets import AnswerReader, BadPacket, decode, encode
from lab_bridge.guard import Guard
from lab_bridge.robot_drivers import RobotHost, make_robot_driver
from lab_bridge.robots_epuck2 import EPuck2Driver
from push_model.settings import SettingsError
from push_scenario.bodies import load_robot
from push_scenario.lab import EPuck2Link

EPUCK = load_robot("epuck")
GO = np.array([0.05, 0.0, 0.0])


class Peer:
    """The robot's side: a server that answers when it is told to."""

    def __init__(self):
        self.server = socket.socket()
        self.server.bind(("127.0.0.1", 0))
        self.server.listen(1)
        self.server.settimeout(2.0)
        self.port = self.server.getsockname()[1]
        self.client = None

    def accept(self):
        self.client, _ = self.server.accept()
        self.client.settimeout(0.3)

    def heard(self):
        """Motor speeds of all commands that have come."""
        data = b""
        try:
            while piece := self.client.recv(4096):
                data += piece
        except TimeoutError:
            pass
        assert len(data) % 21 == 0
        return [decode(data[i : i + 21]) for i in range(0, len(data), 21)]

    def answer(self, data=b"\x03"):
        self.client.sendall(data)
        time.sleep(0.02)  # the loopback takes a moment

    def close(self):
        if self.client is not None:
            self.client.close()
        self.server.close()


@pytest.fixture
def peer():
    made = Peer()
    yield made
    made.close()


def link(peer, **words):
    settings = EPuck2Link(host="127.0.0.1", port=peer.port, **words)
    return make_robot_driver(RobotHost(None, "epuck1", EPUCK, 50.0), settings)


def connected(peer, **words):
    made = link(peer, **words)
    made.poll(0.0)
    peer.accept()
    made.poll(0.01)
    assert made.trouble  # connected, but it has not answered yet
    peer.answer()
    made.poll(0.015)
    assert made.trouble == ""
    return made


def test_a_command_is_that_of_the_makers_description():
    packet = encode(-300, 1000)
    assert packet == b"\x80\x00\x00" + struct.pack("<hh", -300, 1000) + bytes(14)
    assert decode(packet) == (-300, 1000)


@given(st.integers(-32768, 32767), st.integers(-32768, 32767))
def test_speeds_are_read_as_they_were_written(left, right):
    assert decode(encode(left, right)) == (left, right)


@pytest.mark.parametrize(
    "data", [b"", b"\x80" * 20, b"\x81" + bytes(20), b"\x80\x00\x04" + bytes(18)]
)
def test_other_bytes_are_no_command(data):
    with pytest.raises(BadPacket):
        decode(data)


@given(st.lists(st.sampled_from([1, 2, 3]), max_size=4), st.integers(1, 5000))
def test_answers_are_counted_in_pieces_of_any_length(kinds, piece):
    lengths = {1: 38400, 2: 104, 3: 0}
    data = b"".join(bytes([k]) + bytes(lengths[k]) for k in kinds)
    reader = AnswerReader()
    parts = [data[i : i + piece] for i in range(0, len(data), piece)]
    assert sum(map(reader.feed, parts)) == len(kinds)


def test_an_unknown_answer_is_an_error():
    with pytest.raises(BadPacket, match="0x07"):
        AnswerReader().feed(b"\x07")


def test_the_first_command_is_a_stop(peer):
    made = connected(peer)
    made.command(GO, 0.02)
    first, second = peer.heard()
    assert first == (0, 0)
    # 0.05 m/s on wheels of 20.5 mm, 1000 steps a turn
    assert second == (388, 388)
    made.close(0.1)


def test_speeds_beyond_the_motors_are_scaled_by_one_factor(peer):
    made = link(peer, max_steps=500)
    left, right = made.steps(np.array([0.06, 0.0, 1.5]))
    assert right == 500 and left / right == pytest.approx((0.06 - 0.03975) / 0.09975, abs=2e-3)


def test_a_closed_link_ends_with_a_stop(peer):
    made = connected(peer)
    made.command(GO, 0.02)
    made.close(0.03)
    assert peer.heard()[-1] == (0, 0)


def test_commands_do_not_pile_up_but_a_stop_is_sent(peer):
    made = connected(peer)
    peer.answer()
    made.poll(0.02)
    for k in range(20):  # nothing is answered any more
        made.command(GO * (1.0 + 0.01 * k), 0.03 + 0.005 * k)
    sent = peer.heard()
    assert len(sent) <= 4
    made.command(np.zeros(3), 0.135)
    assert peer.heard() == [(0, 0)]
    made.close(0.2)


def test_a_lost_command_is_sent_again(peer):
    made = connected(peer)
    made.command(GO, 0.02)
    peer.heard()
    for k in range(1, 30):
        made.poll(0.02 + 0.01 * k)
    assert (388, 388) in peer.heard()
    made.close(0.5)


def test_a_silent_robot_is_lost_and_found_again_standing(peer):
    made = connected(peer, silence=0.5)
    made.command(GO, 0.02)
    made.poll(0.03)
    made.poll(0.54)
    assert "has not answered for 0.5 s" in made.trouble
    made.command(GO, 0.55)  # goes nowhere
    peer.client.close()
    made.poll(1.0)
    assert made.trouble
    made.poll(1.6)
    peer.accept()
    made.poll(1.61)
    peer.answer()
    made.poll(1.62)
    assert made.trouble == "" and made.connections == 2
    assert peer.heard()[0] == (0, 0)
    made.close(2.0)


def test_a_robot_that_is_not_there_is_named(peer):
    peer.close()
    made = link(peer)
    for k in range(5):
        made.poll(0.01 * k)
    assert "ECONNREFUSED" in made.trouble and str(peer.port) in made.trouble


def test_a_robot_that_hangs_up_or_babbles_is_lost(peer):
    made = connected(peer)
    peer.client.close()
    time.sleep(0.02)
    made.poll(0.05)
    assert "closed the connection" in made.trouble or "lost" in made.trouble
    made.poll(1.1)
    peer.accept()
    made.poll(1.2)
    peer.answer(b"\x55")
    made.poll(1.3)
    assert "0x55" in made.trouble


def test_what_cannot_be_driven_is_refused():
    host = RobotHost(None, "d", load_robot("disc"), 50.0)
    with pytest.raises(SettingsError, match="two wheels"):
        EPuck2Driver(host, EPuck2Link(host="127.0.0.1"))
    host = RobotHost(None, "e", EPUCK, 50.0)
    with pytest.raises(SettingsError, match="cannot be resolved"):
        EPuck2Driver(host, EPuck2Link(host="no.such.host.invalid"))


def test_the_guard_stops_robots_when_the_bridge_dies(peer):
    """A process that holds the pipe is killed; nobody else is there to stop the robot."""
    code = (
        "import time; from lab_bridge.guard import Guard;"
        f"g = Guard([('127.0.0.1', {peer.port})]); print('up', flush=True); time.sleep(60)"
    )
    holder = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    assert holder.stdout.readline() == b"up\n"
    holder.kill()
    holder.wait()
    holder.stdout.close()
    peer.server.settimeout(10.0)
    peer.accept()
    assert peer.client.recv(21, socket.MSG_WAITALL) == encode(0, 0)
    peer.answer()


def test_a_guard_that_is_dismissed_does_nothing(peer):
    guard = Guard([("127.0.0.1", peer.port)])
    guard.dismiss()
    assert guard._process.poll() == 0
    peer.server.settimeout(0.1)
    with pytest.raises(TimeoutError):
        peer.accept()


def test_lost_answers_do_not_hold_up_further_commands(peer):
    """Three answers are lost; from then on every command is answered, once."""
    made = connected(peer)
    peer.client.settimeout(0.001)
    turn, now, sent = np.array([0.0, 0.0, 1.0]), 0.02, []
    for k in range(200):
        now += 0.01
        made.command(GO if k < 50 else turn, now)
        made.poll(now)
        heard = peer.heard()
        sent += heard if k > 130 else []
        if heard and not 40 <= k < 50:
            peer.client.sendall(b"\x03" * len(heard))
        time.sleep(0.001)
    assert sent and set(sent) == {tuple(int(s) for s in made.steps(turn))}
    made.close(now)
