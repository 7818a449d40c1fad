"""Exports a run to a file or folder of another format, which appears whole or not at all."""

from __future__ import annotations

import os
from io import TextIOWrapper
from pathlib import Path

from wayfarer.errors import BadInput
from wayfarer.fieldlog.reader import Damage
from wayfarer.files.atomic_file import atomic_file, atomic_folder
from wayfarer.views.export.formats import ExportFormat, Output


def export(run: Path, form: ExportFormat, out: Path, *, overwrite: bool, follow_symlink: bool = False) -> Damage:
    """Write a run in a format, and return what of its log could not be read.

    ``follow_symlink`` is for a path that a person gave.

    Raises:
        BadInput: there is such a file already, it cannot be written or is no ordinary file, or the run cannot be read.
            A folder is never replaced.
    """
    try:
        if form.output is Output.FOLDER:
            return _export_folder(run, form, out)
        if out.is_dir() or (out.exists() and not overwrite):
            raise BadInput(f"{out} exists already: name another file with --out, or replace it with --force")
        with atomic_file(out, follow_symlink=follow_symlink) as draft:
            if form.output is Output.BYTES:
                return form.write(run, draft)
            text = TextIOWrapper(draft, encoding="utf-8", newline="")
            try:
                return form.write(run, text)
            finally:
                text.detach()  # its end would close the draft
    except OSError as error:
        raise BadInput(
            f"{out} cannot be written: {error.strerror}; check the folder, its rights and the disk"
        ) from None


def _export_folder(run: Path, form: ExportFormat, out: Path) -> Damage:
    if os.path.lexists(out):
        raise BadInput(
            f"{out} exists already, and a folder is never replaced: name another one with --out, or remove it"
        )
    with atomic_folder(out) as draft:
        return form.write(run, draft)
