"""Exports a run to a file or folder of another format, which appears whole or not at all."""

from __future__ import annotations

from pathlib import Path

from wayfarer.errors import BadInput
from wayfarer.fieldlog.atomic_file import whole_file
from wayfarer.fieldlog.reader import Damage
from wayfarer.views.export.formats import ExportFormat, Output


def export(run: Path, form: ExportFormat, out: Path, *, overwrite: bool) -> Damage:
    """Write a run in a format, and return what of its log could not be read.

    Raises:
        BadInput: there is such a file already, it cannot be written or is no ordinary file, or the run cannot be read.
    """
    try:
        if out.is_dir() or (out.exists() and not overwrite):
            raise BadInput(f"{out} is there already: name another file with --out, or replace a file with --force")
        with whole_file(out) as draft:
            if form.output is Output.BYTES:
                with draft.open("wb") as messages:
                    return form.write(run, messages)
            with draft.open("w", encoding="utf-8", newline="") as text:
                return form.write(run, text)
    except OSError as error:
        raise BadInput(
            f"{out} cannot be written: {error.strerror}; check the folder, its rights and the disk"
        ) from None
