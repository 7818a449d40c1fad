"""What each tick makes is used like a named tuple, in the programs of other people too."""

from __future__ import annotations

import copy
import pickle
from collections import namedtuple
from math import inf, nan
from typing import Any

import numpy as np
import pytest

from wayfarer.escape.api import Decision, Observation, Phase
from wayfarer.hal import STOP, CompassReading, ContactReading, MotionReading, WheelCommand, WheelReading
from wayfarer.readings import Value

COMPASS = CompassReading(1.5, 359.9, -3.0, 4.5, 3)
VALUES: list[Value] = [
    COMPASS,
    MotionReading(1.5, 0.05, -0.01, 0.8),
    WheelCommand(0.5, -0.25),
    WheelReading(1.5, 0.05, None, 2.5, 0.0),
    Observation(1.5, 10.0, 0.0, 0.0, (), ContactReading(1.5, (), None), 20.0, 3.0, 2.5, STOP),
    Decision(WheelCommand(0.5, -0.25), Phase.FOLLOW, "follow"),
]


def twin_of(value: Value) -> Any:
    """The named tuple of the same name and values."""
    kind = namedtuple(type(value).__name__, type(value).__match_args__)  # type: ignore[misc]
    return kind(*value)


def test_there_is_a_value_of_each_kind_here() -> None:
    assert {type(value) for value in VALUES} == set(Value.__subclasses__())


@pytest.mark.parametrize("value", VALUES, ids=lambda value: type(value).__name__)
def test_value_is_used_like_the_named_tuple_of_its_values(value: Value) -> None:
    kind, twin = type(value), twin_of(value)
    first, *others = value
    assert (first, *others) == tuple(value) == tuple(twin)
    assert len(value) == len(twin)
    assert value[0] == twin[0]
    assert value[-1] == twin[-1]
    assert value[1:] == twin[1:]
    assert repr(value) == repr(twin)
    assert value._asdict() == twin._asdict()
    assert list(value._asdict()) == list(twin._fields)
    assert kind(*value) == kind(**value._asdict()) == value == twin == tuple(twin)
    assert hash(kind(*value)) == hash(value) == hash(twin)
    assert value != tuple(twin)[:-1]
    assert value != None  # noqa: E711
    for name in twin._fields:
        assert getattr(value, name) == getattr(twin, name)
        assert value._replace(**{name: getattr(value, name)}) == value
    with pytest.raises(TypeError):
        value._replace(nothing=1.0)


@pytest.mark.parametrize("value", VALUES, ids=lambda value: type(value).__name__)
def test_value_is_copied_and_goes_to_another_process(value: Value) -> None:
    for again in (copy.copy(value), copy.deepcopy(value), pickle.loads(pickle.dumps(value))):
        assert type(again) is type(value)
        assert again == value


def test_values_of_one_place_differ() -> None:
    north = COMPASS._replace(heading_deg=0.0)
    assert north != COMPASS
    assert (north.t_s, north.heading_deg, north.calibration) == (1.5, 0.0, 3)
    assert len({north, COMPASS, COMPASS._replace(heading_deg=0.0)}) == 2
    match north:
        case CompassReading(t_s, 0.0, calibration=3):
            assert t_s == 1.5
        case _:
            pytest.fail("no match")


@pytest.mark.parametrize("number", [nan, inf])
def test_numbers_that_a_driver_must_not_give_are_kept_for_the_detector_to_judge(number: float) -> None:
    assert str(COMPASS._replace(pitch_deg=number).pitch_deg) == str(number)


def test_numpy_makes_an_array_of_a_command_as_of_a_tuple() -> None:
    """So an agent of the environment hands on what an algorithm wants."""
    numpy = pytest.importorskip("numpy")
    assert numpy.array(WheelCommand(0.5, -0.25), numpy.float32).tolist() == [0.5, -0.25]
    assert numpy.asarray(STOP).shape == (2,)


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.float16, np.int64, np.uint8, np.array])
def test_numbers_of_numpy_are_taken_and_become_python_s_own(kind: Any) -> None:
    one, command = kind(1), WheelCommand(kind(1), kind(1))
    made = [
        CompassReading(one, one, one, one, kind(1)),
        MotionReading(one, one, one, one, np.bool_(True)),
        WheelReading(one, one, None, one, one),
        command,
        Observation(one, one, one, one, (), None, one, one, one, command),
    ]
    numbers = [number for value in made for number in value if number not in (None, (), command)]
    assert {type(number) for number in numbers} == {float, int, bool}
    assert set(numbers) == {1.0}
