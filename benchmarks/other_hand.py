"""What the other hand would have cost: at a contact, the same trial goes on twice, once with each hand.

The process forks at the contact. Forest, slips, noise and all that happened before are the same in both, and the child
keeps the other hand to its end. The hand is the side to which the rover turns away: +1 clockwise, -1 counter-clockwise.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import atan2, degrees, hypot
from random import Random
from typing import NamedTuple

from wayfarer.angles import wrap180
from wayfarer.config.rover_file import load_rover
from wayfarer.control.run_log import PartialLog
from wayfarer.escape.api import EscapeSettings, Observation, Vehicle
from wayfarer.escape.catalogue import CATALOGUE, Algorithm
from wayfarer.escape.handler import AlgorithmSpec, PhasedHandler
from wayfarer.escape.memory.reckoning import Reckoning
from wayfarer.escape.memory.slip import NOSE_UP_DEG, SlipClassifier
from wayfarer.experiments.campaign import Campaign, Task, read_forest_file
from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.trial import run_watched

BASE = "forest-pledge"
BUDGET_M = 200.0  # a path counts as this long where the rover does not get out: one that circles must not outweigh all
TURN_BACK_DEG = 150.0  # during an episode: from into the wall to along it, the other way
SHARE = 0.25  # of the contacts after the first wall at which the trial forks


class Contact(NamedTuple):
    """What the rover knew at a contact; sides are positive on the side of its hand.

    ``offset_m`` is dead reckoning to the side of the line from the start to the goal, ``bearing_deg`` the heading from
    that line. ``wall_m`` and ``wall_deg`` are the distance and direction from the first contact of the episode, 0 along
    the goal heading and 180 back, ``driven_m`` what was commanded since then; of the episode before where this contact
    begins one. ``counter_deg`` is C, ``last_counter_deg`` the most that it was in the episode before. ``slips`` counts
    anomalies at which the nose stayed level. ``cost_m`` is how much longer the whole path was with the other hand.
    """

    layout: int
    first_wall: bool
    new_episode: bool
    offset_m: float
    ahead_m: float
    bearing_deg: float
    wall_m: float
    wall_deg: float
    driven_m: float
    counter_deg: float
    last_counter_deg: float
    episodes: int
    slips: int
    cost_m: float = 0.0


@dataclass
class Fork:
    """One trial: its hand, which contacts fork, and what came of them; ``answer`` is the pipe of a child."""

    layout: int
    hand: int
    other: int
    chance: Random
    answer: int | None = None
    contacts: list[Contact] = field(default_factory=list)
    paths_m: list[float] = field(default_factory=list)

    def path_with_the_other_hand_m(self) -> float | None:
        """Return the whole path of a child that takes the other hand from here; None: this is that child."""
        loop = asyncio.get_running_loop()
        reading, writing = os.pipe()
        child = os.fork()
        if not child:
            os.close(reading)
            asyncio._set_running_loop(loop)  # asyncio takes no loop for running in another process
            self.answer, self.hand = writing, self.other
            return None
        os.close(writing)
        with os.fdopen(reading, encoding="ascii") as answer:
            path = answer.read()
        os.waitpid(child, 0)
        return float(path)


class ForkingHandler(PhasedHandler):
    """``BASE``, with the hand of the trial, that forks at contacts with a trunk: where the nose rose."""

    def __init__(self, spec: AlgorithmSpec, settings: EscapeSettings, vehicle: Vehicle, rng: Random) -> None:
        self._reckoning = Reckoning(settings.cruise_m_s)
        self._classifier = SlipClassifier(vehicle.width_m)
        super().__init__(spec, settings, vehicle, rng)

    def reset(self) -> None:
        """Forget the episode as well."""
        super().reset()
        self._reckoning.reset()
        self._classifier.reset()
        self._first = self._last = (0.0, 0.0)  # contacts of the episode: ahead, right, metres
        self._most_deg = self._last_most_deg = self._first_m = 0.0
        self._slips = 0

    def _aim(self, observation: Observation) -> Observation:
        self._reckoning.follow(observation, self._manoeuvre.phase)
        self._classifier.follow(observation)
        return observation

    def _plan(self, observation: Observation, *, new_episode: bool) -> None:
        super()._plan(observation, new_episode=new_episode)
        here = (self._reckoning.ahead_m, self._reckoning.right_m)
        trunk = self._classifier.risen_deg(observation.t_s) >= NOSE_UP_DEG
        self._slips += not trunk
        if trunk and not self._blocked_turns:
            self._fork(here, observation, new_episode=new_episode)
        if new_episode:
            self._first, self._first_m = here, observation.travelled_m
            self._last_most_deg, self._most_deg = self._most_deg, 0.0
        self._last = here
        self._most_deg = max(self._most_deg, self._escape_plan.counter_deg * self._side)

    def _fork(self, here: tuple[float, float], observation: Observation, *, new_episode: bool) -> None:
        if _fork.answer is not None or (_fork.contacts and _fork.chance.random() > SHARE):
            return
        contact = self._contact(here, observation, new_episode=new_episode)
        path_m = _fork.path_with_the_other_hand_m()
        if path_m is not None:
            _fork.contacts.append(contact)
            _fork.paths_m.append(path_m)
        elif _fork.other != self._side:
            self._side = self._escape_plan.side = _fork.other
            if not new_episode:
                self._escape_plan.turn_deg = TURN_BACK_DEG

    def _contact(self, here: tuple[float, float], observation: Observation, *, new_episode: bool) -> Contact:
        hand, (ahead_m, right_m) = self._side, self._last if new_episode else here
        along_m, across_m = ahead_m - self._first[0], (right_m - self._first[1]) * hand
        return Contact(
            layout=_fork.layout,
            first_wall=new_episode and not _fork.contacts,
            new_episode=new_episode,
            offset_m=here[1] * hand,
            ahead_m=here[0],
            bearing_deg=wrap180(observation.heading_deg - observation.goal_heading_deg) * hand,
            wall_m=hypot(along_m, across_m),
            wall_deg=degrees(atan2(across_m, along_m)),
            driven_m=observation.travelled_m - self._first_m,
            counter_deg=self._escape_plan.counter_deg * hand,
            last_counter_deg=self._most_deg if new_episode else self._last_most_deg,
            episodes=self._episodes,
            slips=self._slips,
        )


_fork = Fork(0, 1, 1, Random(0))


def _make(settings: EscapeSettings, vehicle: Vehicle, rng: Random) -> ForkingHandler:
    (spec,) = CATALOGUE[BASE].make.args  # type: ignore[attr-defined]  # a row is a partial of its spec
    return ForkingHandler(replace(spec, side=lambda _seen, _settings, _rng: _fork.hand), settings, vehicle, rng)


ALGORITHM = Algorithm("forking", "pledge", "takes either hand at a contact", _make)


def contacts(trials: int, *, parity: int = 0, switches: bool = True) -> Iterator[Contact]:
    """Run trials on the reference layouts with an even (or odd) number, each with both hands; yield their contacts.

    Without ``switches`` the child keeps the same hand: then it must have the path of its parent.
    """
    forests = read_forest_file("reference")
    name = f"{__name__}:ALGORITHM"
    campaign = Campaign((name,), len(forests.forests), load_rover("sim"), forests=forests, budget_m=BUDGET_M)
    chosen = [trial for trial, forest in enumerate(forests.forests) if forest.forest % 2 == parity]
    for trial in chosen[:trials]:
        for hand in (1, -1):
            yield from _run(campaign, name, trial, hand, -hand if switches else hand)


def _run(campaign: Campaign, name: str, trial: int, hand: int, other: int) -> Iterator[Contact]:
    global _fork  # noqa: PLW0603  # the campaign makes the handler by its name
    forest = campaign.make_forest(trial)
    _fork = Fork(forest.forest, hand, other, Random(f"{trial}/{hand}"))
    try:
        result = run_watched(campaign.spec(Task(name, trial), forest), lambda _world, _rover: PartialLog())
        path_m = min(result.path_m, BUDGET_M) if result.outcome in SUCCESSES else BUDGET_M
        if _fork.answer is not None:
            os.write(_fork.answer, repr(path_m).encode())
    finally:
        if _fork.answer is not None:
            os._exit(0)  # the parent reads on from here
    for contact, other_m in zip(_fork.contacts, _fork.paths_m, strict=True):
        yield contact._replace(cost_m=other_m - path_m)
