"""The HTML document of the live page, made of the files in ``page/``, and its security headers."""

from __future__ import annotations

import json
from base64 import b64encode
from hashlib import sha256
from importlib.resources import files
from typing import NamedTuple

from wayfarer.fieldlog.vocabulary import PHASE_TEXTS
from wayfarer.views import palette

# In this order they make one script; each is about one thing.
SCRIPTS = (
    "words.js", "map.js", "zoom.js", "dial.js", "curves.js", "panel.js", "legend.js", "demo.js",
    "rover_clock.js", "hands.js", "manual.js", "connection.js", "main.js",
)  # fmt: skip


class Document(NamedTuple):
    """The page and its headers."""

    html: bytes
    headers: dict[str, str]


def document() -> Document:
    """Put the page together. Its own style and script are all that a browser may run, this server all it may ask."""
    folder = files("wayfarer.views.live") / "page"
    style = palette.css() + (folder / "page.css").read_text(encoding="utf-8")
    scripts = ((folder / name).read_text(encoding="utf-8") for name in SCRIPTS)
    script = "\n".join([f"const PHASES = {json.dumps(PHASE_TEXTS)};", *scripts])
    html = (folder / "page.html").read_text(encoding="utf-8").replace("/* style */", style)
    policy = (
        f"default-src 'none'; style-src {_hash(style)}; script-src {_hash(script)}; connect-src 'self'; img-src data:;"
        " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return Document(
        html.replace("/* script */", script).encode(),
        {
            "Content-Security-Policy": policy,
            "Content-Type": "text/html; charset=utf-8",
            "Cache-Control": "no-store",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Referrer-Policy": "no-referrer",  # the address may hold the token
            "X-Content-Type-Options": "nosniff",
        },
    )


def _hash(text: str) -> str:
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"
