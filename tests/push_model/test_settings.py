from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_model.settings import SettingsError, bounded, from_mapping
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec


@dataclass(frozen=True)
class Inner:
    gain: float = bounded(1.0, low=0.0, high=2.0)


@dataclass(frozen=True)
class Outer:
    name: str
    count: int = 3
    inner: Inner = Inner()
    pair: tuple[float, float] = (0.0, 1.0)


def test_values_and_defaults():
    outer = from_mapping(Outer, {"name": "a", "inner": {"gain": 2}, "pair": [1, 2]})
    assert outer == Outer("a", 3, Inner(2.0), (1.0, 2.0))
    assert isinstance(outer.inner.gain, float)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({}, ["missing", "name"]),
        ({"name": "a", "colour": 1}, ["unknown key 'colour'", "count"]),
        ({"name": 3}, ["f.yaml.name", "3"]),
        ({"name": "a", "count": 1.5}, ["f.yaml.count", "whole number", "1.5"]),
        ({"name": "a", "count": True}, ["whole number"]),
        ({"name": "a", "inner": {"gain": 2.5}}, ["f.yaml.inner.gain", "2.5", "[0.0, 2.0]"]),
        ({"name": "a", "inner": {"gain": float("nan")}}, ["nan"]),
        ({"name": "a", "pair": [1]}, ["f.yaml.pair", "2 values"]),
        ([1], ["mapping"]),
    ],
)
def test_errors_name_place_value_and_expectation(values, words):
    with pytest.raises(SettingsError) as error:
        from_mapping(Outer, values, "f.yaml")
    for word in words:
        assert word in str(error.value)


junk = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=8,
)


@given(
    st.sampled_from([RobotSpec, ObjectSpec, EnvironmentSpec]),
    st.dictionaries(st.sampled_from(["size", "shape", "mass", "boxes", "bumper", "x"]), junk),
)
def test_junk_is_refused_with_a_settings_error_or_accepted(cls, values):
    try:
        from_mapping(cls, values)
    except SettingsError:
        pass
