import dataclasses
import math
import pickle
from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grasp_opt.group_control import GroupControlSettings
from grasp_opt.group_push import GroupPushSettings
from grasp_opt.placement import PlacementSettings
from push_estimation.pose_gate import PoseGateSettings
from push_model.settings import SettingsError, bounded, from_mapping, settings
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_mpc.settings import ContactForceSettings, MpcSettings, TrackerSettings
from push_mpc.torque_tracker import TorqueTrackerSettings
from push_mpc.wheel_slip_nmpc import WheelSlipSettings
from push_planner.settings import PlannerSettings
from push_supervisor.settings import SupervisorSettings
from sim_bridge.planar_world import PlanarSettings
from sim_bridge.settings import BridgeSettings, MotionCaptureSettings, PhysicsSettings
from sim_bridge.viscous_world import ViscousSettings
from swarm_push.agent import AgentSettings
from swarm_push.crescent_law import CrescentLawSettings
from swarm_push.object_track import TrackSettings
from swarm_push.swarm_job import SwarmJobSettings
from swarm_push.thesis_law import ThesisLawSettings

ALL = (
    PoseGateSettings,
    MpcSettings,
    TrackerSettings,
    PlannerSettings,
    SupervisorSettings,
    BridgeSettings,
    MotionCaptureSettings,
    PhysicsSettings,
    ContactForceSettings,
    WheelSlipSettings,
    TorqueTrackerSettings,
    PlanarSettings,
    ViscousSettings,
    PlacementSettings,
    GroupControlSettings,
    GroupPushSettings,
    SwarmJobSettings,
    CrescentLawSettings,
    ThesisLawSettings,
    TrackSettings,
    AgentSettings,
)


@settings
class Inner:
    gain: float = bounded(1.0, low=0.0, high=2.0, doc="[m]")


@settings
class Disc:
    kind: Literal["disc"] = dataclasses.field(default="disc", kw_only=True)
    radius: float = bounded(low=0.0, high=1.0)


@settings
class Bar:
    kind: Literal["bar"] = dataclasses.field(default="bar", kw_only=True)
    length: float


@settings
class Outer:
    name: str
    count: int = 3
    inner: Inner = Inner()
    pair: tuple[float, float] = (0.0, 1.0)
    levels: tuple[float, ...] = bounded((), low=0.0, high=1.0)
    parts: tuple[Inner, ...] = ()
    part: Disc | Bar | None = None
    limit: float | None = bounded(None, low=0.0, high=1.0)
    on: bool = False
    pace: Literal["slow", "fast"] = "slow"

    def __post_init__(self) -> None:
        if self.pair[0] > self.pair[1]:
            raise SettingsError(f"pair must ascend, got {self.pair}")


def test_values_and_defaults():
    values = {
        "name": "a",
        "inner": {"gain": 2},
        "pair": [1, 2],
        "part": {"kind": "bar", "length": 1},
    }
    outer = from_mapping(Outer, values)
    assert outer == Outer("a", 3, Inner(2.0), (1.0, 2.0), part=Bar(1.0))
    assert isinstance(outer.inner.gain, float) and isinstance(outer.pair[0], float)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({}, ["f.yaml: missing key 'name' (str)"]),
        (
            {"name": "a", "colour": 1},
            ["f.yaml: unknown key 'colour'; expected one of: count, inner"],
        ),
        ({"name": 3}, ["f.yaml.name", "text", "3"]),
        ({"name": "a", "count": 1.5}, ["f.yaml.count", "whole number", "1.5"]),
        ({"name": "a", "count": 1.0}, ["f.yaml.count", "whole number", "1.0"]),
        ({"name": "a", "count": True}, ["whole number"]),
        ({"name": "a", "count": "3"}, ["whole number", "'3'"]),
        ({"name": "a", "inner": {"gain": 2.5}}, ["f.yaml.inner.gain: 2.5", "[0.0, 2.0]"]),
        ({"name": "a", "inner": {"gain": True}}, ["f.yaml.inner.gain", "a number, got True"]),
        ({"name": "a", "inner": {"gain": "1"}}, ["f.yaml.inner.gain", "a number, got '1'"]),
        ({"name": "a", "inner": {"gain": math.nan}}, ["f.yaml.inner.gain", "finite", "nan"]),
        ({"name": "a", "inner": {"gain": math.inf}}, ["f.yaml.inner.gain", "finite", "inf"]),
        ({"name": "a", "inner": {"gain": None}}, ["f.yaml.inner.gain", "a number, got None"]),
        ({"name": "a", "inner": {"loss": 1}}, ["f.yaml.inner: unknown key 'loss'", "gain"]),
        ({"name": "a", "inner": 7}, ["f.yaml.inner: expected a mapping, got 7"]),
        ({"name": "a", "pair": [1]}, ["f.yaml.pair", "2 values"]),
        ({"name": "a", "pair": "12"}, ["f.yaml.pair", "a list, got '12'"]),
        ({"name": "a", "pair": [0, math.nan]}, ["f.yaml.pair[1]", "finite", "nan"]),
        ({"name": "a", "pair": [2, 1]}, ["f.yaml: pair must ascend, got (2.0, 1.0)"]),
        ({"name": "a", "levels": [0, 1, 2]}, ["f.yaml.levels[2]: 2", "[0.0, 1.0]"]),
        ({"name": "a", "parts": [{}, {"gain": -1}]}, ["f.yaml.parts[1].gain: -1", "[0.0, 2.0]"]),
        ({"name": "a", "part": {"kind": "ball"}}, ["f.yaml.part.kind", "bar, disc", "'ball'"]),
        ({"name": "a", "part": {"length": 1}}, ["f.yaml.part: missing key 'kind'", "bar, disc"]),
        ({"name": "a", "part": {"kind": "disc"}}, ["f.yaml.part: missing key 'radius' (float)"]),
        ({"name": "a", "part": {"kind": "disc", "radius": 3}}, ["f.yaml.part.radius: 3", "1.0]"]),
        ({"name": "a", "part": {"kind": "disc", "length": 3}}, ["f.yaml.part: unknown", "radius"]),
        ({"name": "a", "part": 3}, ["f.yaml.part", "mapping"]),
        ({"name": "a", "limit": 3}, ["f.yaml.limit: 3", "[0.0, 1.0]"]),
        ({"name": "a", "on": 1}, ["f.yaml.on", "true or false", "1"]),
        ({"name": "a", "pace": "idle"}, ["f.yaml.pace", "slow", "fast", "'idle'"]),
        ({"count": "x", "inner": {"gain": -1}}, ["'name'", ".count", ".inner.gain: -1"]),
        ([1], ["f.yaml: expected a mapping, got [1]"]),
    ],
)
def test_errors_name_place_value_and_expectation(values, words):
    with pytest.raises(SettingsError) as error:
        from_mapping(Outer, values, "f.yaml")
    for word in words:
        assert word in str(error.value)


def test_what_is_wrong_in_a_file_is_wrong_in_code_too():
    with pytest.raises(SettingsError, match=r"PlannerSettings.safety_distance: -1 .*\[0.0, 1.0\]"):
        PlannerSettings(safety_distance=-1)
    with pytest.raises(SettingsError, match="PlannerSettings: length_weight and clearance_weight"):
        PlannerSettings(length_weight=0, clearance_weight=0)
    with pytest.raises(SettingsError, match=r"Inner.gain: 9.0 is out"):
        dataclasses.replace(Inner(), gain=9.0)
    with pytest.raises(SettingsError, match=r"Inner.gain: expected a finite"):
        Inner(math.nan)
    with pytest.raises(SettingsError, match="unknown key 'loss'"):
        Inner(loss=1)
    with pytest.raises(SettingsError, match="missing key 'name'"):
        Outer()
    with pytest.raises(TypeError, match="positional"):
        Inner(1.0, 2.0)
    with pytest.raises(TypeError, match="two values for 'gain'"):
        Inner(1.0, gain=2.0)
    assert Inner(np.float64(1.5)) == Inner(1.5) and Inner(1) == Inner(1.0)


@pytest.mark.parametrize("cls", ALL)
def test_settings_classes_are_plain_frozen_dataclasses(cls):
    made = cls()
    again = from_mapping(cls, dataclasses.asdict(made))
    assert again == made == dataclasses.replace(made) == pickle.loads(pickle.dumps(made))
    assert vars(made) == {f.name: getattr(made, f.name) for f in dataclasses.fields(cls)}
    name = dataclasses.fields(cls)[0].name
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(made, name, getattr(made, name))


@pytest.mark.parametrize("cls", ALL)
def test_every_bound_is_kept_in_files_and_in_code(cls):
    """Each bounded number of each node: just outside is refused by name."""
    tried = 0
    for field in dataclasses.fields(cls):
        whole = isinstance(field.default, int)
        for key, away in (("low", -1.0), ("high", 1.0)):
            edge = field.metadata.get(key)
            if edge is None or math.isinf(edge):
                continue
            outside = int(edge) + int(away) if whole else math.nextafter(edge, away * math.inf)
            for build in (lambda v: cls(**v), lambda v: from_mapping(cls, v)):
                with pytest.raises(SettingsError, match=rf"{field.name}: .* out of range"):
                    build({field.name: outside})
            tried += 1
    assert tried > 5


junk = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=8,
)


@given(
    st.sampled_from([RobotSpec, ObjectSpec, EnvironmentSpec]),
    st.dictionaries(
        st.sampled_from(["size", "shape", "mass", "boxes", "bumper", "drive", "com", "x"]), junk
    ),
)
def test_junk_is_refused_with_a_settings_error_or_accepted(cls, values):
    try:
        from_mapping(cls, values)
    except SettingsError:
        pass
