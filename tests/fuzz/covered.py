"""Which lines of some modules were reached: of their functions, because what runs at import runs anyway."""

from __future__ import annotations

import dis
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

Function = tuple[str, int]  # its file and its first line
_OF_FUNCTIONS = 0x02  # CO_NEWLOCALS, which a class body and a module lack


class Covered:
    """Counts lines while ``watching``.

    Args:
        covers: modules, or a function or class of one as ``module:name``.
    """

    def __init__(self, covers: Sequence[str]) -> None:
        self._missing = {function: lines for each in covers for function, lines in _functions_of(each)}
        self._all = sum(map(len, self._missing.values()))
        self.count = 0

    @property
    def share(self) -> float:
        """Return which share of the lines was reached, from 0 to 1."""
        return self.count / self._all

    @property
    def missing(self) -> dict[str, list[int]]:
        """Return the lines that were not reached, by file."""
        by_file: dict[str, list[int]] = {}
        for (file, _), lines in sorted(self._missing.items()):
            by_file.setdefault(file, []).extend(sorted(lines))
        return {file: lines for file, lines in by_file.items() if lines}

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Count what is reached in this thread; a tool that traced before, as coverage does, goes on afterwards."""
        before = sys.gettrace()
        sys.settrace(self._trace_calls)
        try:
            yield
        finally:
            sys.settrace(before)

    def _trace_calls(self, frame: FrameType, _event: str, _: Any) -> Any:
        """Have the lines of a function told, where some are missing."""
        missing = self._missing.get((frame.f_code.co_filename, frame.f_code.co_firstlineno))

        def trace_lines(frame: FrameType, event: str, _: Any) -> Any:
            if event == "line" and missing and frame.f_lineno in missing:
                missing.remove(frame.f_lineno)
                self.count += 1
            return trace_lines

        return trace_lines if missing else None


def _functions_of(name: str) -> list[tuple[Function, set[int]]]:
    """Return the functions of a module, or of one function or class of it, each with its lines."""
    module, _, within = name.partition(":")
    spec = find_spec(module)
    assert spec is not None and spec.origin is not None, f"there is no module {module}"
    code = compile(Path(spec.origin).read_bytes(), spec.origin, "exec")
    found = list(_functions_in(code, f"{within}." if within else ""))
    assert found, f"there is nothing in {name}"
    return found


def _functions_in(code: CodeType, within: str) -> Iterator[tuple[Function, set[int]]]:
    if code.co_flags & _OF_FUNCTIONS and f"{code.co_qualname}.".startswith(within):
        begins = next(each.offset for each in dis.get_instructions(code) if each.opname == "RESUME")
        lines = {line for offset, line in dis.findlinestarts(code) if offset > begins and line is not None}
        yield (code.co_filename, code.co_firstlineno), lines
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _functions_in(inner, within)
