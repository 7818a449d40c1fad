"""How much there is to read: lines, modules, and lines of code, of the product, the tests and what stands beside them.

A line of code is none that is blank, a comment, a docstring or part of an import: taking out comments changes nothing.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from benchmarks.figures import print_table

ROOT = Path(__file__).parents[1]
PYTHON = ("wayfarer", "tests", "benchmarks", "docs", "examples")
OTHERS = {
    "TOML of wayfarer and tests": ("wayfarer/**/*.toml", "tests/**/*.toml"),
    "pages: JavaScript, CSS, HTML": ("wayfarer/**/*.js", "wayfarer/**/*.css", "wayfarer/**/*.html"),
    "documentation": ("*.md", "docs/**/*.md"),
}


def print_size() -> None:
    """Print the table."""
    rows = [(name, *_counts(sorted((ROOT / name).rglob("*.py")))) for name in PYTHON]
    for name, patterns in OTHERS.items():
        paths = [path for pattern in patterns for path in ROOT.glob(pattern)]
        rows.append((name, str(len(paths)), str(sum(_lines(path) for path in paths)), ""))
    print_table(("what", "files", "lines", "lines of code"), rows)


def _counts(paths: list[Path]) -> tuple[str, str, str]:
    return str(len(paths)), str(sum(map(_lines, paths))), str(sum(len(code_lines(_text(path))) for path in paths))


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def _lines(path: Path) -> int:
    return _text(path).count("\n")


def code_lines(text: str) -> set[int]:
    """Return the numbers of a module's lines of code."""
    tree = ast.parse(text)
    no_code = {line for first, last in _no_code(tree) for line in range(first, last + 1)}
    lines = enumerate(text.splitlines(), start=1)
    return {number for number, line in lines if line.strip() and not line.strip().startswith("#")} - no_code


def _no_code(tree: ast.Module) -> Iterator[tuple[int, int]]:
    """Yield the first and the last line of each import, and of each string that is a statement."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        ):
            yield node.lineno, node.end_lineno or node.lineno
