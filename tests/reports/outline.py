"""The elements of an HTML page, read strictly."""

from __future__ import annotations

from collections import Counter
from html.parser import HTMLParser

VOID = frozenset({"meta", "br", "input"})
URL_ATTRIBUTES = frozenset({"href", "src", "srcset", "action", "data", "xlink:href"})


class Outline(HTMLParser):
    """What is opened is closed, in its order, and no element has an attribute twice.

    ``links`` are the addresses of all elements, ``labels`` what figures show in words.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: Counter[str] = Counter()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.labels: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        assert len(values) == len(attrs), f"{tag} has an attribute twice"
        self.tags[tag] += 1
        self.ids += [value for name, value in attrs if name == "id" and value]
        self.links += [value for name, value in attrs if name in URL_ATTRIBUTES and value]
        self.labels += [values["aria-label"] or ""] if tag == "figure" and "aria-label" in values else []
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag
