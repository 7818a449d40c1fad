"""Reduces a failing scenario to the smallest one that still fails."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from wayfarer.fault_scenarios.scenario import Scenario

AFTERWARDS_S = 5.0  # how long a scenario goes on after what it is about


def shrink(scenario: Scenario, is_broken: Callable[[Scenario], bool]) -> Scenario:
    """Return the scenario without every fault and command that ``is_broken`` does not need; one fault stays.

    Each step runs a scenario, at most as many as the square of faults and commands.
    """
    while (smaller := next(filter(is_broken, _smaller(scenario)), None)) is not None:
        scenario = smaller
    return scenario


def _smaller(scenario: Scenario) -> Iterator[Scenario]:
    if len(scenario.faults) > 1:
        for index in range(len(scenario.faults)):
            yield replace(scenario, faults=scenario.faults[:index] + scenario.faults[index + 1 :])
    for index in range(len(scenario.commands)):
        yield replace(scenario, commands=scenario.commands[:index] + scenario.commands[index + 1 :])
    if not scenario.clearing:
        yield replace(scenario, clearing=True)
    times_s = [fault.at_s for fault in scenario.faults] + [command.at_s for command in scenario.commands]
    last_s = max(times_s)
    if last_s + AFTERWARDS_S < scenario.for_s:
        yield replace(scenario, for_s=last_s + AFTERWARDS_S)
