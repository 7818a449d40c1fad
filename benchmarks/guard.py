"""Did a change of the code change what comes out? Seven campaigns against the results of d4eb2217.

Each campaign runs ``wayfarer sim``, and the SHA-256 of its ``trials.csv`` is compared with the one in
``benchmarks/guard/digests.json``. The same digest: nothing has changed. Another one: the trials are paired with the
stored rows of d4eb2217, which met the same layouts with the same noise, and a table says for success, path and SPL by
how much they changed, with one-sided 95 % bounds. ``worse`` and ``not worse`` are certain by that measure;
``undecided`` needs more pairs (``--trials``).

A change of behaviour on purpose is one commit with its new digests (``--accept``) and this table. The stored rows stay
those of d4eb2217, so that small losses cannot add up.
"""

from __future__ import annotations

import csv
import gzip
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from benchmarks.figures import print_table

STORE = Path(__file__).with_name("guard")
DIGESTS = STORE / "digests.json"
SUCCESSES = {"escaped", "left_bounds"}
CONFIDENCE = 0.95
FEWEST_LAYOUTS = 10  # a bootstrap of fewer says nothing; chosen by us
SAMPLES = 2000  # of the bootstrap: its bounds then move by about 2 % of their width
# At most so much worse, chosen by us: points of success, per cent of path, SPL.
MARGINS = {"success": 0.5, "path": 2.0, "spl": 0.01}

Row = dict[str, str]


@dataclass(frozen=True)
class Campaign:
    """What is run: the options of ``wayfarer sim``, the trials per algorithm of a digest, and those that are stored."""

    options: str
    trials: int
    stored: int


CAMPAIGNS = {
    "ten-algorithms": Campaign("--algorithm paper --forests reference", 6, 30),
    "bus-depth": Campaign("--depth bus --forests reference", 40, 200),
    "field-senses": Campaign("--set senses=field --forests reference", 100, 500),
    "clutter-minirover": Campaign("--site dense-obstruction --rover minirover", 100, 500),
    "mujoco": Campaign("--physics mujoco --forests reference", 4, 40),
    "blind-litter": Campaign("--ground leaf-litter --set sim.blind_share=0.3 --forests reference", 100, 500),
    "slope": Campaign("--set sim.slope_deg=8 --set sim.slope_direction_deg=0:360 --forests reference", 100, 500),
}


def print_guard(names: Sequence[str], trials: int | None, *, accept: bool) -> int:
    """Run campaigns (all if none is named), print what has changed, and return the exit code: 1 if anything is worse.

    ``trials`` asks for so many pairs per algorithm whether the digest has changed or not. ``accept`` writes the new
    digests unless a campaign is worse.
    """
    if unknown := set(names) - CAMPAIGNS.keys():
        print(f"no campaign {', '.join(sorted(unknown))}: there are {', '.join(CAMPAIGNS)}", file=sys.stderr)
        return 2
    digests: dict[str, str] = json.loads(DIGESTS.read_text(encoding="utf-8"))
    found: dict[str, str] = {}
    changes: list[tuple[str, ...]] = []
    for name in names or CAMPAIGNS:
        campaign = CAMPAIGNS[name]
        text = run(campaign, campaign.trials)
        found[name] = sha256(text).hexdigest()
        same = found[name] == digests.get(name)
        print(f"{name}: {'the same bytes' if same else 'CHANGED'} ({found[name][:12]})", flush=True)
        if trials or not same:
            more = run(campaign, min(trials, campaign.stored)) if trials and trials > campaign.trials else text
            changes += compare(name, stored_rows(name), rows_of(more))
    if changes:
        print()
        print_table(
            ("campaign", "algorithm", "figure", "pairs", "d4eb2217", "now", "change", "bound", "verdict"), changes
        )
    worse = any(change[-1] == "worse" for change in changes)
    if accept and not worse:
        DIGESTS.write_text(json.dumps(digests | found, indent=2) + "\n", encoding="utf-8")
    return int(worse or (not accept and any(found[name] != digests.get(name) for name in found)))


def run(campaign: Campaign, trials: int) -> bytes:
    """Return the ``trials.csv`` of a campaign that this Python's ``wayfarer`` runs."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        options = [*campaign.options.split(), "--spl", "--trials", str(trials)]
        jobs = str(len(os.sched_getaffinity(0)))
        command = [sys.executable, "-m", "wayfarer", "sim", *options, "--jobs", jobs, "--out", str(out)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise SystemExit(f"wayfarer sim {' '.join(options)} ended with exit code {done.returncode}: {done.stderr}")
        return (out / "trials.csv").read_bytes()


def stored_rows(name: str) -> list[Row]:
    """Return the rows of d4eb2217."""
    return rows_of(gzip.decompress((STORE / f"{name}.csv.gz").read_bytes()))


def rows_of(text: bytes) -> list[Row]:
    """Return the rows of a ``trials.csv``."""
    return list(csv.DictReader(text.decode().splitlines()))


def compare(name: str, before: Iterable[Row], now: Iterable[Row]) -> Iterator[tuple[str, ...]]:
    """Return the lines of the table that have changed, for each algorithm and figure over the trials that both ran."""
    old = {(row["algorithm"], row["trial"]): row for row in before}
    by_algorithm: dict[str, list[tuple[Row, Row]]] = {}
    for row in now:
        if (match := old.get((row["algorithm"], row["trial"]))) is not None:
            by_algorithm.setdefault(row["algorithm"], []).append((match, row))
    for algorithm, pairs in by_algorithm.items():
        if all(was == row for was, row in pairs):
            continue
        for figure, margin in MARGINS.items():
            groups = by_layout(figure, pairs)
            if not groups:
                continue
            change = CHANGES[figure]
            low, high = bounds(groups, change)
            flat = [pair for group in groups for pair in group]
            verdict = "not worse" if low >= -margin else "worse" if high < -margin else "undecided"
            if len(groups) < FEWEST_LAYOUTS:
                verdict = "undecided"
            was, is_now = (sum(values) / len(flat) for values in zip(*flat, strict=True))
            moved = f"{change(groups):+.3g}"
            interval = f"{low:+.3g} to {high:+.3g}"
            yield name, algorithm, figure, str(len(flat)), f"{was:.4g}", f"{is_now:.4g}", moved, interval, verdict


Groups = list[list[tuple[float, float]]]


def by_layout(figure: str, pairs: Iterable[tuple[Row, Row]]) -> Groups:
    """Return a figure before and now, in groups of one layout: trials of one layout are not independent samples."""
    groups: dict[str, list[tuple[float, float]]] = {}
    for was, row in pairs:
        both_out = was["outcome"] in SUCCESSES and row["outcome"] in SUCCESSES
        if figure == "path" and not both_out:  # a path that ended somewhere in the wood is not a length of an escape
            continue
        value = VALUES[figure]
        groups.setdefault(row["forest"], []).append((value(was), value(row)))
    return list(groups.values())


VALUES: dict[str, Callable[[Row], float]] = {
    "success": lambda row: 100.0 * (row["outcome"] in SUCCESSES),
    "path": lambda row: float(row["path_m"]),
    "spl": lambda row: float(row["spl"] or 0.0),
}


def difference(groups: Groups) -> float:
    """Return the mean of now less that of before."""
    flat = [now - was for group in groups for was, now in group]
    return sum(flat) / len(flat)


def shorter_percent(groups: Groups) -> float:
    """Return by how many per cent paths have become shorter: positive is better, as for the other figures."""
    before = sum(was for group in groups for was, _ in group)
    now = sum(now for group in groups for _, now in group)
    return 100.0 * (before - now) / before


CHANGES: dict[str, Callable[[Groups], float]] = {"success": difference, "path": shorter_percent, "spl": difference}


def bounds(groups: Groups, change: Callable[[Groups], float]) -> tuple[float, float]:
    """Return the lower and the upper one-sided 95 % bound of a change: a bootstrap of layouts."""
    chance = Random(0)
    drawn = sorted(change(chance.choices(groups, k=len(groups))) for _ in range(SAMPLES))
    outside = round((1.0 - CONFIDENCE) * SAMPLES)
    return drawn[outside], drawn[-1 - outside]
