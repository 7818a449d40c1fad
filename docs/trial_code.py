"""The version of a table of results: a checksum of the code that a trial runs."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

# What decides no byte of ``trials.csv`` at device depth, below the package: how trials are spread over processes,
# written and shown, the daemon, people, and what only bus depth uses. All else counts, with rovers and forests.
NOT_RUN = (
    *("api", "cli", "commissioning", "daemon", "export", "fieldlog", "gym", "logview", "remote", "reports", "testing"),
    *("simhal/chips", "simhal/buses.py", "simhal/pins.py", "simhal/register_chip.py"),
    *(
        f"experiments/{name}.py"
        for name in (
            *("checks", "dask_cluster", "measures", "paper", "pool", "provenance", "recorded", "results", "run"),
            *("tables", "trial_log"),
        )
    ),
    *("__init__.py", "__main__.py", "demo.py", "errors.py", "extras.py", "files.py", "run_sim.py", "version.py"),
    *("vocabulary.py", "waiting_thread.py"),
    "skeletons",  # what ``wayfarer new`` writes: only an installation has it there
)
COUNTED = ("**/*.py", "rovers/*.toml", "simhal/world/*.gz")


def code_of(package: Path) -> str:
    """Return the checksum of what a trial runs, in a folder that holds the package ``wayfarer``.

    It is the same for any Python. Comments, docstrings and blank lines do not count.
    """
    made = sha256()
    for path in sorted(path for pattern in COUNTED for path in package.glob(pattern)):
        name = path.relative_to(package).as_posix()
        if not any(name == left_out or name.startswith(f"{left_out}/") for left_out in NOT_RUN):
            content = path.read_bytes()
            made.update(f"{name}\n".encode())
            made.update(code_lines(content.decode()).encode() if path.suffix == ".py" else content)
    return made.hexdigest()[:10]


def code_lines(source: str) -> str:
    """Return the lines of a module that a computer runs."""
    lines = source.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            line, column = token.start
            lines[line - 1] = lines[line - 1][:column]
    for text in _plain_strings(ast.parse(source)):
        lines[text.lineno - 1 : text.end_lineno] = [""] * ((text.end_lineno or text.lineno) - text.lineno + 1)
    return "\n".join(line.rstrip() for line in lines if line.strip())


def _plain_strings(tree: ast.Module) -> Iterator[ast.Expr]:
    """Yield the strings that are statements: docstrings, and what stands below a setting."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node
