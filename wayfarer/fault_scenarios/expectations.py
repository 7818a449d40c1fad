"""Expectations of a scenario besides its level: required and forbidden events, even ticks, stopped wheels."""

from __future__ import annotations

from itertools import pairwise
from math import inf

from wayfarer.fault_scenarios.recorder import RunRecorder
from wayfarer.fault_scenarios.scenario import Expectation

ROUNDING_S = 1e-6


def violations(expect: Expectation, monitor: RunRecorder, begun_s: float) -> list[str]:
    """Return what a run did against what is expected from ``begun_s`` on, in words; empty where nothing."""
    return [
        *_unanswered(expect, monitor, begun_s),
        *_unwanted(expect, monitor, begun_s),
        *_gaps(expect, monitor),
        *_still_turning(expect, monitor, begun_s),
    ]


def _unanswered(expect: Expectation, monitor: RunRecorder, begun_s: float) -> list[str]:
    if not expect.answer:
        return []
    wanted = " or ".join(expect.answer)
    for moment in monitor.moments:
        if moment.t_s >= begun_s and moment.why in expect.answer:
            after_s = moment.t_s - begun_s
            late = after_s > expect.within_s + ROUNDING_S
            return [f"{moment.why} after {after_s:.2f} s, {expect.within_s:g} s are allowed"] if late else []
    return [f"the escape logic never answered by {wanted}"]


def _unwanted(expect: Expectation, monitor: RunRecorder, begun_s: float) -> list[str]:
    came = {happening.name for happening in monitor.recorded_events if happening.t_s >= begun_s}
    for moment in monitor.moments:
        if moment.t_s >= begun_s:
            came |= {moment.why, *(condition.value for condition in moment.conditions)}
    return [f"there was '{name}', which must not come" for name in expect.never if name in came]


def _gaps(expect: Expectation, monitor: RunRecorder) -> list[str]:
    most_s = expect.ticks_within_s
    if most_s is None:
        return []
    gap_s = max((now.t_s - last.t_s for last, now in pairwise(monitor.moments)), default=0.0)
    return [f"{gap_s:.2f} s between two ticks, {most_s:g} s are allowed"] if gap_s > most_s + ROUNDING_S else []


def _still_turning(expect: Expectation, monitor: RunRecorder, begun_s: float) -> list[str]:
    if expect.stands_within_s is None:
        return []
    stood_s = min((t_s for t_s, still in monitor.stood_still_s if still and t_s >= begun_s), default=inf) - begun_s
    late = stood_s > expect.stands_within_s + ROUNDING_S
    return [f"the wheels stopped after {stood_s:.2f} s, {expect.stands_within_s:g} s are allowed"] if late else []
