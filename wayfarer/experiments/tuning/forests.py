"""The forests of a search: some to develop on, and others, with other numbers, that the search never sees.

Generated forests are made once, with their shortest paths where SPL is searched for, and kept in the folder as files
of forests: ``wayfarer sim --forests`` can repeat every trial. Of a file of forests, those with even numbers are for the
search, and those with odd numbers are held out. A site draws its layouts itself; held out are those of another seed.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from hashlib import blake2b

from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import NOISES_PER_LAYOUT, Campaign, ForestFile
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.forest_file import as_row

DEVELOPMENT, HELD_OUT = "development.jsonl", "held-out.jsonl"


def development(base: Campaign) -> Campaign:
    """Return the campaign on the forests of the search.

    Raises:
        BadInput: its file has no forests for the search, or none to hold out.
    """
    if base.scenario is not None:
        return base
    numbers = [forest.forest for forest in base.forests.forests] if base.forests else [0, 1]
    if lacks := {"even", "odd"} - {"odd" if number % 2 else "even" for number in numbers}:
        raise BadInput(
            f"the file of forests has none with an {lacks.pop()} number: a search needs even ones to develop on, "
            "and odd ones to confirm"
        )
    return _on(base, DEVELOPMENT, _forests(base, 0, parity=0))


def held_out(base: Campaign, trials: int) -> Campaign:
    """Return a campaign of so many trials on forests that the search of ``base`` does not see."""
    if base.scenario is not None:
        return replace(base, seed=(base.seed + 1) % 2**63, trials=trials)
    first = -(-base.trials // NOISES_PER_LAYOUT) * NOISES_PER_LAYOUT
    other = replace(base, trials=trials)
    return _on(other, HELD_OUT, _forests(other, first, parity=1))


def content_of(campaign: Campaign) -> bytes:
    """Return a campaign's own forests as a file of forests has them; nothing of a site."""
    return _content(campaign.forests.forests) if campaign.forests else b""


def _forests(base: Campaign, first: int, parity: int) -> Sequence[Forest]:
    """Return the forests of the trials, generated from trial ``first`` on, or of the file's with that parity."""
    if base.forests is None:
        return [base.make_forest(first + trial) for trial in range(base.trials)]
    half = tuple(forest for forest in base.forests.forests if forest.forest % 2 == parity)
    here = replace(base, forests=replace(base.forests, forests=half))
    return [here.make_forest(trial) for trial in range(min(base.trials, len(half)))]


def _on(base: Campaign, name: str, forests: Sequence[Forest]) -> Campaign:
    checksum = blake2b(_content(forests), digest_size=16).hexdigest()
    return replace(base, spl=False, forests=ForestFile(name, checksum, tuple(forests)))


def _content(forests: Sequence[Forest]) -> bytes:
    return b"".join(json.dumps(as_row(forest)).encode() + b"\n" for forest in forests)
