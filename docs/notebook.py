"""A Jupyter notebook as Markdown, with the outputs that it was saved with."""

from __future__ import annotations

import json
from base64 import b64encode
from typing import Any


def as_markdown(notebook: str) -> str:
    """Return the cells of a notebook's JSON in order: texts, code, and below each what it printed or drew."""
    return "\n\n".join(part for cell in json.loads(notebook)["cells"] for part in _cell(cell))


def _cell(cell: dict[str, Any]) -> list[str]:
    source = "".join(cell["source"])
    if cell["cell_type"] == "markdown":
        return [source]
    return [f"```python\n{source}\n```", *(_output(output) for output in cell["outputs"])]


def _output(output: dict[str, Any]) -> str:
    if output["output_type"] == "stream":
        return f"```text\n{''.join(output['text']).rstrip()}\n```"
    data = output["data"]
    if "image/svg+xml" in data:
        picture = b64encode("".join(data["image/svg+xml"]).encode()).decode()
        return f"![What the cell above draws](data:image/svg+xml;base64,{picture})"
    return f"```text\n{''.join(data['text/plain'])}\n```"
