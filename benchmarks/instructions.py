"""Instructions of a control tick, of ``import wayfarer.cli`` and of a daemon's start, counted by valgrind's callgrind.

Seconds vary by 20 to 30 % on a computer that does other work, which hides growth by small steps. The same code takes
the same instructions, to 0.2 %. ``--gate`` compares this checkout with the commit that it is to be merged into, both as
``pip install`` makes them, and fails if a figure has grown by 3 % or more and no commit since then says why.
"""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.figures import print_table

ROOT = Path(__file__).parents[1]
EXTRAS = "sim,live"  # those of the README's first command
LIMIT = 0.03
TICK, IMPORT, START = "a control tick", "import wayfarer.cli", "a daemon's start, until it is ready"
# The line of a commit's message that begins so says why this figure may grow.
TRAILERS = {TICK: "Slower-tick", IMPORT: "Slower-import", START: "Slower-start"}

# Callgrind writes its counts, and begins again from zero, at each call of a function of the C library that nothing else
# here calls. What happens once, in the first campaign, is not a part of a tick.
TRIALS = """
import os, sys
mark = os.getppid
def sim(trials):
    sys.argv[1:] = ["sim", "--jobs", "1", "--json", "--trials", str(trials)]
    try:
        main()
    except SystemExit as end:
        if end.code:
            raise
    mark()
mark()
from wayfarer.cli import main
mark()
sim(1)
sim(1)
sim(6)
"""
TICKS = re.compile(r'"ticks": (\d+)')
# Sets have one order, no thread of numpy's counts its turns while it waits, and what is imported has been compiled.
ENVIRONMENT = {"PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": ""}


class NotCompared(Exception):
    """There is nothing to compare with; the text says why."""


class CannotCount(Exception):
    """What is counted has failed; the text says how."""


def print_instructions(python: str | None, *, gate: bool, functions: int) -> int:
    """Print the figures, and return the exit code: 1 if the gate finds one that has grown.

    Args:
        python: one in which wayfarer is installed; None is this one, and for the gate a new one with this checkout.
        gate: compare with the commit that this one is to be merged into.
        functions: how many of a tick's costliest compiled functions to print, each with all that it calls.
    """
    if shutil.which("valgrind") is None:
        print("not counted: valgrind is not installed")
        return 0
    with TemporaryDirectory() as folder, ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        work = Path(folder)
        try:
            if gate:
                return _gate(python, work, pool)
            counts = count(python or sys.executable, work / "now", pool)()
        except NotCompared as why:
            print(f"not compared: {why}")
            return 0
        except CannotCount as why:
            print(f"not counted: {why}", file=sys.stderr)
            return 1
        print_table(("instructions", ""), [(what, f"{counts[what]:,.0f}") for what in TRAILERS])
        if functions:
            print_functions(work / "now" / "trials.5", functions)
    return 0


def _gate(python: str | None, work: Path, pool: ThreadPoolExecutor) -> int:
    base = base_of(ROOT)
    os.environ.pop("PYTHONPATH", None)  # it would put a checkout before what is installed
    then = pool.submit(install_commit, base, work / "before")
    now = pool.submit(lambda: python or install(ROOT, work / "now"))
    before, after = count(then.result(), work / "before", pool), count(now.result(), work / "now", pool)
    try:
        counts = before()
    except CannotCount as why:
        raise NotCompared(f"in {base[:8]}, {why}") from why
    rows, grown = judge(counts, after(), reasons_since(base, ROOT))
    print_table(("instructions", base[:8], "now", "change", f"limit {LIMIT:+.0%}"), rows)
    for what in grown:
        print(f"{what} takes more than in {base[:8]}: make it cheaper, or give the reason in a commit's message, on a "
              f"line {TRAILERS[what]}: REASON", file=sys.stderr)  # fmt: skip
    return 1 if grown else 0


def judge(
    before: Mapping[str, float], now: Mapping[str, float], reasons: Mapping[str, str]
) -> tuple[list[tuple[str, ...]], list[str]]:
    """Return the rows of the table, and the figures that have grown without a reason."""
    rows: list[tuple[str, ...]] = []
    grown: list[str] = []
    for what in TRAILERS:
        change = now[what] / before[what] - 1.0
        too_much = change >= LIMIT
        if too_much and what not in reasons:
            grown.append(what)
        verdict = "met" if not too_much else reasons.get(what, "**missed**")
        rows.append((what, f"{before[what]:,.0f}", f"{now[what]:,.0f}", f"{change:+.2%}", verdict))
    return rows, grown


# -- what to compare with ----------------------------------------------------------------------------------------------


def base_of(root: Path) -> str:
    """Return the commit where this branch left main; on main itself the one before.

    Raises:
        NotCompared: there is none here.
    """
    head = _git(root, "rev-parse", "--verify", "--quiet", "HEAD")
    if not head:
        raise NotCompared("there is no git history here")
    for main in ("origin/main", "main"):
        base = _git(root, "merge-base", "HEAD", main)
        if base and base != head:
            return base
    before = _git(root, "rev-parse", "--verify", "--quiet", "HEAD^")
    if not before:
        raise NotCompared("the commit before this one is not here: a clone with --depth 1?")
    return before


def reasons_since(base: str, root: Path) -> dict[str, str]:
    """Return the figures that the commits since ``base`` let grow, with the reason."""
    found = {}
    for what, trailer in TRAILERS.items():
        told = _git(root, "log", f"--format=%(trailers:key={trailer},valueonly)", f"{base}..HEAD").split("\n")
        if reason := next(filter(str.strip, told), None):
            found[what] = reason
    return found


def _git(root: Path, *arguments: str) -> str:
    """Return what git says, nothing if it refuses or is not there."""
    try:
        return subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=False).stdout.strip()
    except OSError:
        return ""


def install_commit(commit: str, into: Path) -> str:
    """Return a Python in a new environment with a commit of this checkout.

    Raises:
        NotCompared: that commit cannot be installed.
    """
    source = into / "source"
    source.mkdir(parents=True)
    archive = subprocess.run(["git", "archive", commit], cwd=ROOT, stdout=subprocess.PIPE, check=True).stdout
    subprocess.run(["tar", "-x"], cwd=source, input=archive, check=True)
    try:
        return install(source, into)
    except subprocess.CalledProcessError as error:
        raise NotCompared(f"{commit[:8]} cannot be installed: {error}") from error


def install(source: Path, into: Path) -> str:
    """Return a Python in a new environment with a checkout as ``pip install`` makes it."""
    subprocess.run([sys.executable, "-m", "venv", into / "venv"], check=True)
    python = into / "venv" / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "--quiet", f"{source}[{EXTRAS}]"], check=True)
    return str(python)


# -- counting ----------------------------------------------------------------------------------------------------------


def count(python: str, folder: Path, pool: ThreadPoolExecutor) -> Callable[[], dict[str, float]]:
    """Begin to count an installation, with callgrind's files in a folder; what is returned waits for the figures."""
    folder.mkdir(exist_ok=True)
    jobs = [pool.submit(each, python, folder) for each in (_count_trials, _count_start)]
    return lambda: {what: n for job in jobs for what, n in job.result().items()}


def _count_trials(python: str, folder: Path) -> dict[str, float]:
    for counted in ([], _callgrind(folder / "trials", "getppid")):  # the first run may still have to write bytecode
        command = [*counted, python, "-P", "-c", TRIALS]
        environment = {**os.environ, **ENVIRONMENT}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            raise CannotCount("trials fail: " + (done.stderr.strip().splitlines() or [""])[-1])
    _, few, many = map(int, TICKS.findall(done.stdout))
    imported, small, large = (_total(folder / f"trials.{part}") for part in (2, 4, 5))
    return {TICK: (large - small) / (many - few), IMPORT: imported}


def _count_start(python: str, folder: Path) -> dict[str, float]:
    """Count until the daemon tells systemd that it is ready; callgrind writes that before it lets it do so."""
    for counted in ([], _callgrind(folder / "start", "sendto")):
        with TemporaryDirectory(dir=folder) as private, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notified:
            notified.bind(f"{private}/notify")
            notified.settimeout(1.0)
            environment = {
                **os.environ, **ENVIRONMENT, "NOTIFY_SOCKET": f"{private}/notify", "RUNTIME_DIRECTORY": private,
            }  # fmt: skip
            command = [*counted, python, "-P", "-m", "wayfarer", "run", "--sim", "--log-dir", f"{private}/logs"]
            process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            try:
                _wait_until_ready(process, notified)
            finally:
                process.kill()
                process.wait()
    return {START: _total(folder / "start.1")}


def _wait_until_ready(process: subprocess.Popen[bytes], notified: socket.socket) -> None:
    while process.poll() is None:
        with suppress(TimeoutError):
            if b"READY=1" in notified.recv(1000):
                return
    raise CannotCount(f"wayfarer run --sim ends with exit code {process.returncode} before it is ready")


def _callgrind(out: Path, mark: str) -> list[str]:
    """Return the beginning of a command that counts: ``out.1`` gets what comes before the first call of ``mark``."""
    return ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", f"--dump-before={mark}"]


def _total(part: Path) -> int:
    return int(re.findall(r"^totals: (\d+)", part.read_text(encoding="utf-8"), re.MULTILINE)[0])


def print_functions(part: Path, most: int) -> None:
    """Print the costliest compiled functions of one of callgrind's files, each with all that it calls."""
    command = ["callgrind_annotate", "--inclusive=yes", "--auto=no", "--threshold=100", str(part)]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = re.findall(r"\( *([\d.]+%)\).*:CPyDef_(wayfarer___\w+)", told)
    print()
    print_table(("share", "function"), [(share, name.replace("___", ".")) for share, name in found[:most]])
