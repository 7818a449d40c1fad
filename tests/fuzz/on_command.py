"""The command line, and the environment it finds: an exit code and one line, never a traceback."""

from __future__ import annotations

import io
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, redirect_stderr, redirect_stdout
from math import inf
from pathlib import Path
from unittest.mock import patch

from hypothesis import strategies as st

from tests.fuzz.damage import TEXTS, as_json, json_of
from tests.fuzz.on_control import HostileServer
from tests.fuzz.on_files import MEMORY
from tests.fuzz.target import Target, Try, reading, shape
from tests.logview.records import SAMPLE_LOGS
from wayfarer import cli
from wayfarer.config.calibration_file import calibration_file
from wayfarer.daemon.socket.paths import known_sockets
from wayfarer.daemon.watchdog import SystemdNotifier, watchdog_period_s

CODES = {0, 1, 2, 3, 75}

# What a shell can hand on: no NUL, and half a character if bytes were no UTF-8.
WORD = st.sampled_from(
    (*(text.replace("\0", "") for text in TEXTS), "0", "360", "359.999", "-0", "1e400", "nan", "inf", "-1", "٣", "12,5",
     "9" * 5_000, "last", "1", "--", "--json", "--help", "--north", "true", "\udcff", "a\udc80b", "/", ".", "x" * 5_000)
) | st.text(st.characters(exclude_characters="\0"), max_size=6)  # fmt: skip
LOGS = str(SAMPLE_LOGS)
ASKING = st.builds(
    lambda verb, words: [verb, *words],
    st.sampled_from(("status", "arm", "disarm", "hold", "resume", "goal", "mark", "stop")), st.lists(WORD, max_size=3),
)  # fmt: skip
LOOKING = st.builds(
    lambda verb, words: ["logs", verb, *words, "--log-dir", LOGS],
    st.sampled_from(("list", "show", "summary", "check")), st.lists(WORD, max_size=2),
) | st.builds(
    lambda verb, words: [verb, *words],
    st.sampled_from(("list", "replay", "report", "check", "run", "export", "no-such", "logs")),
    st.lists(WORD.filter(lambda word: word != "--"), min_size=1, max_size=2),
).map(lambda words: [*words, "--no-such-option"])  # fmt: skip


def run(arguments: Sequence[str]) -> str:
    """Run a command; return its exit code and the shape of what it said of an error."""
    said, errors = io.StringIO(), io.StringIO()
    with redirect_stdout(said), redirect_stderr(errors):
        code = cli.run(list(arguments))
    assert code in CODES, code
    error = errors.getvalue()
    if code not in (0, 3):
        assert error.count("\n") == 1, error
        assert error.rstrip("\n").isprintable(), error
    return f"{code} {shape(error)}"


@contextmanager
def _commanded() -> Iterator[Try]:
    """Run commands where nobody listens."""
    with tempfile.TemporaryDirectory(prefix="wf-", dir=MEMORY) as folder, _socket_in(Path(folder)):
        yield run


@contextmanager
def _socket_in(folder: Path) -> Iterator[None]:
    """Have the client look for the daemon in a folder, and nowhere else: there may be real ones."""
    with patch("wayfarer.daemon.socket.client.known_sockets", lambda: [folder / "control.sock"]):
        yield


COMMAND = Target(
    "command",
    ASKING | LOOKING,
    _commanded,
    quick=10,
)  # fmt: skip


# -- a daemon of another version ------------------------------------------------------------------------------------

STATUS = {
    "ok": True, "rover": "minirover", "mode": "armed", "being_checked": False, "held": False, "simulated": False,
    "dry_run": False, "conditions": [], "motor_faults": [], "heading_deg": 12.5, "pitch_deg": 1.0, "roll_deg": -1.0,
    "battery_v": 12.1,
    "goal_heading_deg": 0.0, "why": "follow", "algorithm": "pledge", "counter_deg": 30.0, "anomalies": ["nose_up"],
    "mission_s": 12.0, "travelled_m": 3.0, "log": "logs/1", "log_dropped": 2, "why_disarmed": "",
}  # fmt: skip
ARMED = {"ok": True, "warnings": ["no GPS"], "start_delay_s": 10.0}
STOPPED = {"ok": True, "log": "logs/1"}
GOAL = {"ok": True, "goal_heading_deg": 90.0}
ASKED = (("status", STATUS), ("arm", ARMED), ("stop", STOPPED), ("goal", GOAL))
WORDS = {"goal": ["goal", "90"]}


@contextmanager
def _answered() -> Iterator[Try]:
    with tempfile.TemporaryDirectory(prefix="wf-") as folder, _socket_in(Path(folder)):
        server = HostileServer(Path(folder) / "control.sock")

        def attempt(case: tuple[str, bytes]) -> str:
            verb, server.reply = case
            return run(WORDS.get(verb, [verb]))

        yield attempt
        server.close()


ANSWER = Target(
    "answer",
    st.one_of(
        *(
            st.tuples(st.just(verb), json_of([reply], 3).map(lambda reply: as_json(reply) + b"\n"))
            for verb, reply in ASKED
        )
    ),
    _answered,
    quick=20,
)


# -- the environment ------------------------------------------------------------------------------------------------

PLACES = st.sampled_from(
    ("", ":", "/", "/nowhere", "relative", "/dev/null", "x" * 5_000, "/" + "x" * 300, "\udcff", "a:b")
)
COUNTS = st.sampled_from(("", "0", "-1", "1e6", "2000000", " 5", "٣", "9" * 5_000, "9" * 4_000, "nan", "²"))
ENVIRONMENTS = st.fixed_dictionaries(
    {},
    optional={
        "RUNTIME_DIRECTORY": PLACES,
        "XDG_RUNTIME_DIR": PLACES,
        "STATE_DIRECTORY": PLACES,
        "NOTIFY_SOCKET": PLACES | st.just("@abstract"),
        "WATCHDOG_USEC": COUNTS,
        "WATCHDOG_PID": COUNTS | st.just(str(os.getpid())),
    },
)


def _environment(environment: Mapping[str, str]) -> str:
    """See what watchdog, notifier, calibration and client make of an environment."""
    period_s = watchdog_period_s(environment)
    assert period_s is None or 0.0 < period_s < inf
    notifier = SystemdNotifier(environment.get("NOTIFY_SOCKET"))
    notifier.status("a mark \udcff\n")
    assert calibration_file(environment, Path("/root")).name
    with patch.dict("os.environ", environment):
        return f"{period_s is None}, {reading(lambda: f'{len(list(known_sockets()))} places')}"


ENVIRONMENT = Target(
    "environment",
    ENVIRONMENTS,
    lambda: nullcontext(_environment),
)
