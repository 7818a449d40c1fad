"""Measure the tables of results again: ``python -m docs.measure``, or only some campaigns by their names.

It runs the ``wayfarer`` that this Python has installed, each campaign into a separate folder, and writes its table
into the pages (``measured_tables``). What is finished is not run again, and what was interrupted goes on. A table's
version is the checksum of the code that a trial runs, so a changed page or command makes no table old.

``--check`` computes the first three trials of each row of each table again, with each seed, and compares bytes with
those that were measured: ``docs/measured.json`` has their checksums. ``.ci/run`` does that.
"""

from __future__ import annotations

import csv
import json
import platform
import signal
import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory

from docs.measured_tables import Measured, write_pages
from docs.trial_code import code_of
from wayfarer.files import write_atomically
from wayfarer.simhal.world.forest_file import REFERENCE, content_of

ROOT = Path(__file__).resolve().parents[1]
HELD_OUT = "odd.jsonl"  # the half of the reference forests that nothing was tuned to
FIRST = 3  # trials of each row that ``--check`` computes again

_SITE = "--algorithm forest-pledge,levy-walk,retry-pledge --trials 100 --seed 1,2,3,4 --spl"  # 400 layouts
_CHALLENGE = "--algorithm forest-pledge,retry-pledge --trials 20"
_DEAD_SIDE = "sim --rover forestrover --forests reference --trials 30 --fault drive@10 --ground"
_GROUNDS = "sweep ground=ideal,leaf-litter,dry-soil,mud"
_SLIPPERY = f"{_GROUNDS} --trials 100 --seed 1"
_BOTH = "--algorithm forest-pledge,retry-pledge --trials 1000"
_MUJOCO = (
    "sim --physics mujoco --rover forestrover --seed 6 --spl --algorithm forest-pledge,retry-pledge --trials 100 "
    "--budget-m 400 --set sim.friction"
)
_ANGLE = "sweep escape.turn_angle_deg"
_SOURCES = (
    "sweep anomaly_source=motion,wheels,current,wheels+current --algorithm retry-pledge --trials 200 --seed 48 --spl "
    "--set senses=field --set detector.stall_current_a=11 --ground"
)

CAMPAIGNS: Mapping[str, str] = {
    "paper-10": "sim --algorithm paper --forests reference --trials 1000",
    "paper-2": "sim --algorithm paper --forests reference --trials 1000 --slip-mean-m 2",
    "held-10": f"sim --forests {HELD_OUT} --spl {_BOTH}",
    "held-2": f"sim --forests {HELD_OUT} --spl {_BOTH} --slip-mean-m 2",
    "fresh-10": f"sim --seed 6 --spl {_BOTH}",
    "fresh-2": f"sim --seed 6 --spl {_BOTH} --slip-mean-m 2",
    "field-senses": f"sim --forests reference --spl {_BOTH} --set senses=field",
    "maze-forestrover": f"sim --site extended-maze --rover forestrover {_SITE}",
    "maze-minirover": f"sim --site extended-maze --rover minirover {_SITE}",
    "clutter-forestrover": f"sim --site dense-obstruction --rover forestrover {_SITE}",
    "clutter-minirover": f"sim --site dense-obstruction --rover minirover {_SITE}",
    "challenge-forestrover": f"sim --site forest-escape --rover forestrover {_CHALLENGE}",
    "challenge-minirover": f"sim --site forest-escape --rover minirover {_CHALLENGE}",
    "slippery-maze-forestrover": f"{_SLIPPERY} --site extended-maze --rover forestrover",
    "slippery-maze-minirover": f"{_SLIPPERY} --site extended-maze --rover minirover",
    "slippery-clutter-forestrover": f"{_SLIPPERY} --site dense-obstruction --rover forestrover",
    "slippery-clutter-minirover": f"{_SLIPPERY} --site dense-obstruction --rover minirover",
    "body": "sweep footprint_m=0.2:0.8:0.2 --trials 500 --spl",
    "grounds": f"{_GROUNDS} --trials 500 --budget-m 250 --forests reference --spl",
    "angle-10": f"{_ANGLE}=10,20,30,40,50,60,80,100,120,150,180 --trials 500 --forests reference --spl",
    "angle-2": f"{_ANGLE}=10,30,50,90,180 --trials 500 --forests reference --spl --slip-mean-m 2",
    "sources-litter": f"{_SOURCES} leaf-litter",
    "sources-soil": f"{_SOURCES} dry-soil",
    "dead-side-ideal": f"{_DEAD_SIDE} ideal",
    "dead-side-litter": f"{_DEAD_SIDE} leaf-litter",
    "dead-side-soil": f"{_DEAD_SIDE} dry-soil",
    "mujoco-mud": f"{_MUJOCO}=0.15",
    "mujoco-litter": f"{_MUJOCO}=0.4",
    "mujoco-soil": f"{_MUJOCO}=0.65",
}
"""The arguments of ``wayfarer`` by the campaign's name, in the order of running. Of several seeds each is run apart."""


def main() -> int:
    """Run the campaigns that are asked for, write the tables of those that are finished, and return the exit code."""
    parser = ArgumentParser(prog="python -m docs.measure", description="Measure the tables of results again.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"campaigns (default: all): {', '.join(CAMPAIGNS)}")
    parser.add_argument("--check", action="store_true", help="compare the first trials with those of the tables")
    parser.add_argument("--trials", type=int, metavar="N", help="a try: trials of each row, and no page is written")
    parser.add_argument("--jobs", type=int, metavar="N", help="number of processes (default: one per core)")
    parser.add_argument("--out", type=Path, default=ROOT / "measured", metavar="DIR", help="folder of the results")
    asked = parser.parse_args()
    if unknown := set(asked.names) - set(CAMPAIGNS):
        parser.error(f"no campaign {', '.join(sorted(unknown))}; there are {', '.join(CAMPAIGNS)}")
    names, code = asked.names or [*CAMPAIGNS], installed_code()
    if asked.check:
        return check(names, code)
    folder = asked.out / code
    folder.mkdir(parents=True, exist_ok=True)
    write_held_out(folder)
    campaigns = {name: Measured(folder, name, CAMPAIGNS[name], asked.trials) for name in CAMPAIGNS}
    ended = 0
    signal.signal(signal.SIGINT, lambda *_: None)  # Ctrl-C reaches the campaign too, which ends in order
    try:
        for name in names:
            run(campaigns[name], asked.jobs)
    except subprocess.CalledProcessError as error:  # the campaign has told why
        ended = error.returncode
    finished = {name: each for name, each in campaigns.items() if each.finished}
    if asked.trials is None:
        keep_first_rows(finished)
        for page in write_pages(ROOT / "docs", finished):
            print(page)
    return ended


def installed_code() -> str:
    """Return the checksum of what a trial runs, of the installed wayfarer."""
    command = [sys.executable, "-c", "import wayfarer; print(wayfarer.__path__[0])"]
    done = subprocess.run(command, cwd=ROOT.parent, stdout=subprocess.PIPE, text=True, check=True)
    return code_of(Path(done.stdout.strip()))


def write_held_out(folder: Path) -> None:
    """Write the forests of odd layouts, a line each, where campaigns look for them."""
    lines = content_of(REFERENCE).splitlines(keepends=True)
    (folder / HELD_OUT).write_bytes(b"".join(line for line in lines if json.loads(line)["forest"] % 2))


def run(campaign: Measured, jobs: int | None) -> None:
    """Run a campaign to its end, as far as it is not finished.

    Raises:
        CalledProcessError: it failed or was interrupted, and its folder is kept.
    """
    for part in campaign.parts:
        if part.printed is None:
            print(f"{campaign.name}: wayfarer {' '.join(part.words)}", file=sys.stderr)
            running = ["--out", part.results.name, "--resume", "--json", *(["--jobs", str(jobs)] if jobs else [])]
            write_atomically(part.end, _wayfarer(campaign.folder, [*part.words, *running]).encode())


def _wayfarer(folder: Path, arguments: Iterable[str]) -> str:
    """Run the installed wayfarer in a folder, which is not a checkout: there Python would import that instead."""
    command = [sys.executable, "-m", "wayfarer", *arguments]
    return subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True, check=True).stdout


# -- are the tables still true? ----------------------------------------------------------------------------------------


KEPT = Path(__file__).with_name("measured.json")


def keep_first_rows(finished: Mapping[str, Measured]) -> None:
    """Keep the checksums of the first rows of these campaigns, for ``check``; those of others stay."""
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    kept |= {name: _kept(each) for name, each in finished.items()}
    kept = {name: kept[name] for name in CAMPAIGNS if name in kept}
    KEPT.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


def _kept(campaign: Measured) -> dict[str, str | None]:
    with (campaign.parts[0].results / "trials.csv").open(encoding="utf-8", newline="") as file:
        columns = [name for name in next(csv.reader(file)) if name not in {"shortest_path_m", "spl"}]
    return {"columns": ",".join(columns), "digest": digest(campaign, columns), "engine": engine_of(campaign)}


def digest(campaign: Measured, columns: Sequence[str]) -> str:
    """Return a checksum of the first trials of each row of its table, with each seed.

    ``columns`` are those that count: a column that is new since makes no table old. Shortest paths need an extra, and
    depend on the layout only.
    """
    made = sha256()
    for part in campaign.parts:
        with (part.results / "trials.csv").open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                if int(row["trial"]) < FIRST:
                    made.update((",".join(row.get(name, "?") for name in columns) + "\n").encode())
    return made.hexdigest()[:16]


def engine_of(campaign: Measured) -> str | None:
    """Return which MuJoCo a campaign uses, whose bytes may differ from those of others: "" if none is installed."""
    if "mujoco" not in campaign.words:
        return None
    try:
        return f"MuJoCo {version('mujoco')} on {platform.machine()}"
    except PackageNotFoundError:
        return ""


def check(names: Iterable[str], code: str) -> int:
    """Compute the first trials of these tables again, say which have changed, and return the exit code."""
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    with TemporaryDirectory() as made:
        folder = Path(made)
        write_held_out(folder)
        old = [name for name in names if not _same(Measured(folder, name, CAMPAIGNS[name], FIRST), kept.get(name))]
    print(f"the code of a trial here: {code}")
    return int(bool(old))


def _same(campaign: Measured, before: Mapping[str, str] | None) -> bool:
    """Say whether the first trials of a table have the bytes that were kept, and return False if not."""
    if before is None:
        print(f"{campaign.name}: NEVER MEASURED", flush=True)
        return False
    if before["engine"] != (engine := engine_of(campaign)):
        print(f"{campaign.name}: left out: measured with {before['engine']}, here is {engine or 'none'}", flush=True)
        return True
    for part in campaign.parts:
        words = [word for word in part.words if word != "--spl"]
        _wayfarer(campaign.folder, [*words, "--out", part.results.name, "--json"])
    same = digest(campaign, before["columns"].split(",")) == before["digest"]
    print(f"{campaign.name}: {'the same bytes' if same else 'CHANGED: measure all tables again'}", flush=True)
    return same


if __name__ == "__main__":
    sys.exit(main())
