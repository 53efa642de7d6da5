"""Frames from single poses, the rate of commands, the time of a lab."""

import numpy as np
import pytest

from lab_bridge.frame_assembly import FrameAssembler
from lab_bridge.lab_clock import LabClock
from lab_bridge.throttle import Throttle

GO, STOP = np.array([0.1, 0.0, 0.5]), np.zeros(3)


def test_a_frame_is_complete_when_all_are_there():
    frames = FrameAssembler(["a", "b"], hold=0.004)
    assert frames.add("a", 1, 10.0, 0.0) == []
    (frame,) = frames.add("b", 2, 10.0, 0.001)
    assert (frame.stamp, frame.parts, frame.arrived) == (10.0, {"a": 1, "b": 2}, 0.001)
    assert frames.poll(1.0) == []


def test_a_lost_pose_does_not_hold_up_the_frame_for_long():
    frames = FrameAssembler(["a", "b"], hold=0.004)
    frames.add("a", 1, 10.0, 0.0)
    assert frames.poll(0.003) == []
    (frame,) = frames.poll(0.0041)
    assert frame.parts == {"a": 1}


def test_a_later_instant_or_the_same_body_begins_a_frame():
    frames = FrameAssembler(["a", "b"], hold=0.004)
    frames.add("a", 1, 10.0, 0.0)
    (first,) = frames.add("b", 2, 10.008, 0.001)
    (second,) = frames.add("b", 3, 10.0085, 0.002)
    assert first.parts == {"a": 1} and second.parts == {"b": 2}


def test_commands_are_rare_and_stops_are_at_once():
    throttle = Throttle(10.0)
    assert throttle.offer(GO, 0.0) is GO
    assert throttle.offer(2 * GO, 0.01) is None
    assert throttle.offer(STOP, 0.02) is STOP
    assert throttle.offer(STOP, 0.03) is None  # it stands already
    assert throttle.offer(3 * GO, 0.05) is None
    assert throttle.due(0.11) is None
    assert throttle.due(0.1201) == pytest.approx(3 * GO)
    assert throttle.due(1.0) is None


def test_after_a_loss_a_stop_is_sent_whatever_was_sent_before():
    throttle = Throttle(10.0)
    throttle.offer(STOP, 0.0)
    throttle.clear()
    assert throttle.offer(STOP, 0.01) is STOP


def test_the_time_of_a_lab_goes_on_between_frames():
    clock = LabClock()
    assert clock.read(5.0) == 0.0 and clock.silence(5.0) == float("inf")
    clock.set(1000.0, 5.0)
    assert clock.read(5.1) == pytest.approx(1000.1) and clock.silence(5.1) == pytest.approx(0.1)
    assert clock.read(4.9) == 1000.0  # never before the frame
