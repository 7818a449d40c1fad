"""The version of a table of results: a checksum of the code that a trial runs."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

# What decides the bytes of ``trials.csv`` at device depth, below the package: decisions, the loop, the world, the
# rovers. Not there: drivers and chips, logs, pages, commands.
RUNS = (
    *("angles.py", "readings.py", "setting_ranges.py", "hal.py", "rovers/*.toml"),
    *(f"{package}/*.py" for package in ("escape", "safety", "detector", "control", "config")),
    *(f"simhal/{name}.py" for name in ("parts", "random_streams", "sensor_models", "build_rover")),
    *(f"simhal/{package}/*.py" for package in ("clock", "world", "mujoco")),
    *(f"experiments/{name}.py" for name in ("outcome", "keys", "trial", "trial_setup")),
)


def code_of(package: Path) -> str:
    """Return the checksum of what a trial runs, in a folder that holds the package ``wayfarer``.

    It is the same for any Python. Comments, docstrings and blank lines do not count.
    """
    made = sha256()
    for path in sorted(path for pattern in RUNS for path in package.glob(pattern)):
        text = path.read_text(encoding="utf-8")
        made.update(f"{path.relative_to(package)}\n{code_lines(text) if path.suffix == '.py' else text}\n".encode())
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
