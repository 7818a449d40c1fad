"""Which lines of some modules were reached: of their functions, because what runs at import runs anyway.

Cheap where Python can forget a line that was reached once (3.12 and later), and slow enough to notice before.
"""

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
_TOOL = 4  # of sys.monitoring; 0 to 3 and 5 have their users
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
        """Count what is reached in this thread."""
        begin, end = (self._monitor, _monitor_no_more) if sys.version_info >= (3, 12) else (self._trace, _trace_no_more)
        begin()
        try:
            yield
        finally:
            end()

    def _reach(self, code: CodeType, line: int) -> None:
        missing = self._missing.get((code.co_filename, code.co_firstlineno))
        if missing and line in missing:
            missing.remove(line)
            self.count += 1

    def _trace(self) -> None:
        missing, reach = self._missing, self._reach

        def trace_lines(frame: FrameType, event: str, _: Any) -> Any:
            if event == "line":
                reach(frame.f_code, frame.f_lineno)
            return trace_lines

        def trace_calls(frame: FrameType, _event: str, _: Any) -> Any:
            code = frame.f_code
            return trace_lines if missing.get((code.co_filename, code.co_firstlineno)) else None

        sys.settrace(trace_calls)

    def _monitor(self) -> None:
        monitoring: Any = getattr(sys, "monitoring")  # noqa: B009 - unknown to mypy at 3.11

        def on_line(code: CodeType, line: int) -> Any:
            self._reach(code, line)
            return monitoring.DISABLE

        monitoring.use_tool_id(_TOOL, "wayfarer fuzz")
        monitoring.register_callback(_TOOL, monitoring.events.LINE, on_line)
        monitoring.restart_events()
        monitoring.set_events(_TOOL, monitoring.events.LINE)


def _trace_no_more() -> None:
    sys.settrace(None)


def _monitor_no_more() -> None:
    monitoring: Any = getattr(sys, "monitoring")  # noqa: B009
    monitoring.set_events(_TOOL, 0)
    monitoring.free_tool_id(_TOOL)


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
