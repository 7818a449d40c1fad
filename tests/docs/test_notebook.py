"""The notebook runs from top to bottom, and gives the outputs that it was saved with."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from docs.build import NOTEBOOK, ROOT

nb_run = pytest.importorskip("nbmake.nb_run", reason="notebooks run with nbmake, of the extra test")


def outputs(notebook: Any) -> list[tuple[str, list[Any]]]:
    """What each cell printed, and showed. In how many pieces it is printed depends on how busy the computer is."""
    return [
        (
            "".join(output["text"] for output in cell["outputs"] if "text" in output),
            [shown(output["data"]) for output in cell["outputs"] if "data" in output],
        )
        for cell in notebook["cells"]
        if cell["cell_type"] == "code"
    ]


def shown(data: Any) -> str:
    """A table as HTML, else the text; a plot is saved as a picture of the size of its page, and has its own tests."""
    text: str = data["text/plain"]
    return text if text.startswith("<Plot") else data.get("text/html", text)


@pytest.mark.process
def test_notebook_gives_the_outputs_that_it_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """CONTRIBUTING.md says how to save it again with new outputs."""
    import nbformat

    monkeypatch.setenv("PYTHONPATH", str(ROOT), prepend=os.pathsep)
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    saved = nbformat.read(ROOT / NOTEBOOK, as_version=4)
    ran = nb_run.NotebookRun(ROOT / NOTEBOOK, 120).execute()
    assert ran.error is None
    assert outputs(ran.nb) == outputs(saved)
    assert all(text or what for text, what in outputs(saved))
    assert len((ROOT / NOTEBOOK).read_bytes()) < 500_000, "saved by python -m docs.notebook, without BokehJS"
