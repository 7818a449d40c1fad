"""Fuzz for a while; see the package for what is fuzzed and how."""

from __future__ import annotations

import argparse
import faulthandler
import platform
import re
import secrets
import sys
import traceback
import warnings
from pathlib import Path

from tests.fuzz.engine import Found, fuzz_for
from tests.fuzz.target import Target
from tests.fuzz.targets import TARGETS

HANGS_S = 120.0  # beyond what a target has: then its stack is shown, and all ends
MINUTE_S = 60.0
SHOWN_CHARACTERS = 600
COLUMNS = "{:<18} {:>7} {:>9} {:>7}  {}"


def main() -> int:
    """Fuzz, print a table, and return 1 if a case failed."""
    asked = _arguments()
    warnings.simplefilter("error")
    seed = asked.seed if asked.seed is not None else 0 if asked.seconds else secrets.randbits(32)
    targets = [target for target in TARGETS if asked.only in (None, target.name)]
    each_s = (asked.seconds or asked.minutes * MINUTE_S) / len(targets)
    print(f"Python {platform.python_version()}, seed {seed}, {each_s:.1f} s for each target\n")
    print(COLUMNS.format("target", "cases", "outcomes", "lines", "failure"))
    return max([_fuzz(target, each_s, seed, asked) for target in targets])


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    length = parser.add_mutually_exclusive_group(required=True)
    length.add_argument("--seconds", type=float, help="for all targets together, from seed 0 unless told otherwise")
    length.add_argument("--minutes", type=float, help="the same, from a new seed each time")
    parser.add_argument("--only", choices=[target.name for target in TARGETS], help="one target")
    parser.add_argument("--seed", type=int, help="begin with this")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="write failing cases to files in this folder")
    parser.add_argument("--missing", action="store_true", help="say which lines were not reached")
    return parser.parse_args()


def _fuzz(target: Target, for_s: float, seed: int, asked: argparse.Namespace) -> int:
    faulthandler.dump_traceback_later(for_s + HANGS_S, exit=True)
    found = fuzz_for(target, for_s, seed)
    faulthandler.cancel_dump_traceback_later()
    said = "" if found.error is None else f"{type(found.error).__name__}: {found.error}".partition("\n")[0][:80]
    print(COLUMNS.format(found.target, found.cases, len(found.outcomes), f"{found.coverage:.0%}", said), flush=True)
    if asked.missing:
        for file, lines in found.missing.items():
            print(f"    {file}: {', '.join(map(str, lines))}")
    if found.error is None:
        return 0
    _tell(found, asked.keep)
    return 1


def _tell(found: Found, keep: Path | None) -> None:
    """Show a failing case as it can be pasted, or say where it is."""
    traceback.print_exception(found.error, file=sys.stdout)
    shown = repr(found.case)
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
        file = keep / f"{re.sub('[^a-z0-9]', '-', found.target)}.py"
        file.write_text(f"CASE = {shown}\n", encoding="utf-8", errors="backslashreplace")
        print(f"the case is in {file}")
    elif len(shown) > SHOWN_CHARACTERS:
        print(f"the case: {shown[:SHOWN_CHARACTERS]}... ({len(shown)} characters; --keep DIR writes all of it)")
    else:
        print(f"the case: {shown}")


if __name__ == "__main__":
    sys.exit(main())
