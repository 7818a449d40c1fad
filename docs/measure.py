"""Measure the tables of results again: ``python -m docs.measure``, or only some campaigns by their names.

It runs the ``wayfarer`` that this Python has installed, each campaign into a folder of its version, and writes its
table into the pages (``measured_tables``). What is finished for this version is not run again, and what was interrupted
goes on. Install wayfarer from a commit, not as editable: then its version names the commit, and the core is compiled.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Iterable, Mapping
from pathlib import Path

from docs.measured_tables import Measured, write_pages
from wayfarer.files import write_atomically
from wayfarer.simhal.world.forest_file import REFERENCE, content_of

ROOT = Path(__file__).resolve().parents[1]
HELD_OUT = "odd.jsonl"  # the half of the reference forests that nothing was tuned to

_AT_SITE = "--algorithm forest-pledge,levy-walk --trials 200 --spl"
_CHALLENGE = "--algorithm forest-pledge,retry-pledge --trials 20"
_GROUNDS = "sweep ground=ideal,leaf-litter,dry-soil,mud"
_SLIPPERY = f"{_GROUNDS} --trials 50"
_BOTH = "--algorithm forest-pledge,retry-pledge --trials 1000"
_ANGLE = "sweep escape.turn_angle_deg"

CAMPAIGNS: Mapping[str, str] = {
    "clutter-forestrover": f"sim --site dense-obstruction --rover forestrover {_AT_SITE}",
    "clutter-minirover": f"sim --site dense-obstruction --rover minirover {_AT_SITE}",
    "maze-forestrover": f"sim --site extended-maze --rover forestrover {_AT_SITE}",
    "maze-minirover": f"sim --site extended-maze --rover minirover {_AT_SITE}",
    "held-10": f"sim --forests {HELD_OUT} {_BOTH}",
    "held-2": f"sim --forests {HELD_OUT} {_BOTH} --slip-mean-m 2",
    "fresh-10": f"sim --seed 6 --spl {_BOTH}",
    "fresh-2": f"sim --seed 6 --spl {_BOTH} --slip-mean-m 2",
    "challenge-forestrover": f"sim --site forest-escape --rover forestrover {_CHALLENGE}",
    "challenge-minirover": f"sim --site forest-escape --rover minirover {_CHALLENGE}",
    "slippery-maze-forestrover": f"{_SLIPPERY} --site extended-maze --rover forestrover",
    "slippery-maze-minirover": f"{_SLIPPERY} --site extended-maze --rover minirover",
    "slippery-clutter-forestrover": f"{_SLIPPERY} --site dense-obstruction --rover forestrover",
    "slippery-clutter-minirover": f"{_SLIPPERY} --site dense-obstruction --rover minirover",
    "body": "sweep footprint_m=0.2:0.8:0.2 --trials 500 --spl",
    "grounds": f"{_GROUNDS} --trials 500 --budget-m 250 --forests reference",
    "angle-10": f"{_ANGLE}=10,20,30,40,50,60,80,100,120,150,180 --trials 500 --forests reference",
    "angle-2": f"{_ANGLE}=10,30,50,90,180 --trials 500 --forests reference --slip-mean-m 2",
    "paper-10": "sim --algorithm paper --forests reference --trials 1000",
    "paper-2": "sim --algorithm paper --forests reference --trials 1000 --slip-mean-m 2",
}
"""The arguments of ``wayfarer`` by the campaign's name; those that say most for their time come first."""


def main() -> int:
    """Run the campaigns that are asked for, write the tables of those that are finished, and return the exit code."""
    parser = ArgumentParser(prog="python -m docs.measure", description="Measure the tables of results again.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"campaigns (default: all): {', '.join(CAMPAIGNS)}")
    parser.add_argument("--trials", type=int, metavar="N", help="trials of each row, in place of the campaign's own")
    parser.add_argument("--jobs", type=int, metavar="N", help="number of processes (default: one per core)")
    parser.add_argument("--out", type=Path, default=ROOT / "measured", metavar="DIR", help="folder of the results")
    asked = parser.parse_args()
    if unknown := set(asked.names) - set(CAMPAIGNS):
        parser.error(f"no campaign {', '.join(sorted(unknown))}; there are {', '.join(CAMPAIGNS)}")
    installed = version()
    if installed.endswith("+dev"):
        parser.error(f"wayfarer {installed} runs from a checkout, so its version names no commit; pip install . first")
    folder = asked.out / installed
    folder.mkdir(parents=True, exist_ok=True)
    (folder / HELD_OUT).write_bytes(held_out(content_of(REFERENCE)))
    campaigns = {name: Measured(folder, name, CAMPAIGNS[name], asked.trials) for name in CAMPAIGNS}
    code = 0
    signal.signal(signal.SIGINT, lambda *_: None)  # Ctrl-C reaches the campaign too, which ends in order
    try:
        for name in asked.names or CAMPAIGNS:
            run(campaigns[name], asked.jobs)
    except subprocess.CalledProcessError as error:  # the campaign has told why
        code = error.returncode
    for page in write_pages(ROOT / "docs", {name: each for name, each in campaigns.items() if each.printed}):
        print(page)
    return code


def version() -> str:
    """Return the version of the installed wayfarer, without the word whether it is compiled."""
    return _wayfarer(ROOT.parent, ["--version"]).split()[1]


def held_out(reference: bytes) -> bytes:
    """Return the forests of odd layouts, a line each."""
    return b"".join(line for line in reference.splitlines(keepends=True) if json.loads(line)["forest"] % 2)


def run(campaign: Measured, jobs: int | None) -> None:
    """Run a campaign to its end, unless it is finished.

    Raises:
        CalledProcessError: it failed or was interrupted, and its folder is kept.
    """
    if campaign.printed is None:
        print(f"{campaign.name}: {campaign.command}", file=sys.stderr)
        running = ["--out", campaign.results.name, "--resume", "--json", *(["--jobs", str(jobs)] if jobs else [])]
        told = _wayfarer(campaign.folder, [*campaign.words, *running])
        write_atomically(campaign.end, told.encode())


def _wayfarer(folder: Path, arguments: Iterable[str]) -> str:
    """Run the installed wayfarer in a folder, which is no checkout: there Python would import that instead."""
    command = [sys.executable, "-m", "wayfarer", *arguments]
    return subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True, check=True).stdout


if __name__ == "__main__":
    sys.exit(main())
