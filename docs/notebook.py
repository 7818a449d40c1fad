"""The Jupyter notebook of the documentation: ``python -m docs.notebook`` runs it and saves it with what it shows."""

from __future__ import annotations

import json
import shutil
from base64 import b64encode
from pathlib import Path
from typing import Any

NOTEBOOK = Path(__file__).parent / "tutorial" / "campaign.ipynb"
WIDTH_PX = 900


def as_markdown(notebook: str) -> str:
    """Return the cells of a notebook's JSON in order: texts, code, and below each what it printed or showed."""
    return "\n\n".join(part for cell in json.loads(notebook)["cells"] for part in _cell(cell))


def _cell(cell: dict[str, Any]) -> list[str]:
    source = "".join(cell["source"])
    if cell["cell_type"] == "markdown":
        return [source]
    return [f"```python\n{source}\n```", *(_output(output) for output in cell["outputs"])]


def _output(output: dict[str, Any]) -> str:
    if output["output_type"] == "stream":
        return f"```text\n{''.join(output['text']).rstrip()}\n```"
    data = {kind: "".join(content) for kind, content in output["data"].items()}
    if "image/png" in data:
        return f"![What the cell above draws](data:image/png;base64,{data['image/png'].strip()})"
    return data.get("text/html") or f"```text\n{data['text/plain']}\n```"


def save() -> None:
    """Run the notebook, and save it with its outputs; of each plot a picture: it has 1.4 MB of BokehJS."""
    import nbformat
    from nbclient import NotebookClient
    from playwright.sync_api import sync_playwright

    notebook = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(notebook, timeout=600, record_timing=False).execute()
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH_PX, "height": WIDTH_PX})
        for cell in notebook.cells:
            for data in (output.data for output in cell.get("outputs", ()) if "data" in output):
                if data["text/plain"].startswith("<Plot"):
                    page.set_content(data.pop("text/html"))
                    page.frame_locator("iframe").locator("html[data-plotted]").wait_for()
                    page.wait_for_timeout(500.0)  # until it is as high as what is in it
                    data["image/png"] = b64encode(page.locator("iframe").screenshot()).decode()
                elif "text/html" in data:
                    data["text/plain"] = data["text/plain"].partition("\n")[0]  # of a list of dicts
        browser.close()
    nbformat.write(notebook, NOTEBOOK)


if __name__ == "__main__":
    save()
