"""Random streams: each consumer its own, the same for ever."""

from __future__ import annotations

from statistics import fmean, pstdev

from hypothesis import given
from hypothesis import strategies as st

from wayfarer.simhal.random_streams import BLOCK, RandomStreams

names = st.text(min_size=1, max_size=20)


def draws(seed: int, name: str, count: int) -> list[float]:
    normal = RandomStreams(seed).normal(name, 1.0)
    return [normal.draw() for _ in range(count)]


@given(seed=st.integers(0, 2**63), name=names)
def test_stream_follows_from_seed_and_name(seed: int, name: str) -> None:
    assert draws(seed, name, 5) == draws(seed, name, 5)
    assert RandomStreams(seed).random(name).random() == RandomStreams(seed).random(name).random()


@given(drawn=st.integers(0, 2 * BLOCK))
def test_drawing_from_one_stream_does_not_change_another(drawn: int) -> None:
    streams = RandomStreams(7)
    greedy, modest = streams.normal("flow", 1.0), streams.normal("compass.heading", 1.0)
    first = modest.draw()
    for _ in range(drawn):
        greedy.draw()
    streams.random("algorithm").random()
    assert [first, *(modest.draw() for _ in range(4))] == draws(7, "compass.heading", 5)


def test_streams_of_other_names_and_seeds_differ() -> None:
    assert len({draws(seed, name, 1)[0] for seed in range(100) for name in ("a", "b", "ab", "ba")}) == 400


def test_normal_stream_has_its_mean_and_spread_across_blocks() -> None:
    normal = RandomStreams(1).normal("a", 3.0)
    values = [normal.draw() for _ in range(40 * BLOCK)]
    assert abs(fmean(values)) < 0.1
    assert abs(pstdev(values) - 3.0) < 0.1
    assert len(set(values)) == len(values)
