"""Exports a run to another format."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TextIO

from wayfarer.errors import BadInput
from wayfarer.fieldlog.atomic_file import whole_file
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.views.text.tables import csv_rows, further_columns, tsv_rows
from wayfarer.views.text.verdict import readable


def export(run: Path, form: str, out: Path, *, overwrite: bool) -> Damage:
    """Write a run as ``csv``, ``tsv`` or ``mcap`` to a file, which appears whole or not at all; return what it lacks.

    Raises:
        BadInput: there is such a file already, it cannot be written or is no ordinary file, or the run cannot be read.
    """
    try:
        if out.is_dir() or (out.exists() and not overwrite):
            raise BadInput(f"{out} is there already: name another file with --out, or replace a file with --force")
        with whole_file(out) as draft:
            if form == "mcap":
                from wayfarer.views.foxglove.mcap_file import write_mcap

                with draft.open("wb") as messages:
                    return write_mcap(run, messages)
            with draft.open("w", encoding="utf-8", newline="") as table:
                return write_table(run, form, table)
    except OSError as error:
        raise BadInput(
            f"{out} cannot be written: {error.strerror}; check the folder, its rights and the disk"
        ) from None


def write_table(run: Path, form: str, file: TextIO) -> Damage:
    """Write a run as ``csv`` or ``tsv`` to an open file, and return what of it could not be read.

    Raises:
        BadInput: the run cannot be read.
    """
    reader = RunReader(run)
    if form == "tsv":
        csv.writer(file, delimiter="\t", lineterminator="\n").writerows(tsv_rows(readable(reader)))
    else:
        further = further_columns(readable(reader))
        csv.writer(file, lineterminator="\n").writerows(csv_rows(RunReader(run), further))
    return reader.damage
