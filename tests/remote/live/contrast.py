"""Contrast of the text on a page, by the formula of WCAG 2.2: at least 7 to 1 can be read in sunlight (level AAA)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.logview.test_palette import contrast

if TYPE_CHECKING:
    from playwright.sync_api import Page

AAA = 7.0

# Every element that shows text of its own, with its colour and the first ground behind it that is not see-through.
_TEXTS = """() => [...document.querySelectorAll("body *")].flatMap((element) => {
  const shows = [...element.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
  if (!shows || !element.checkVisibility() || ["SCRIPT", "STYLE"].includes(element.tagName)) return [];
  const style = getComputedStyle(element);
  let ground = element;
  const seen = (each) => getComputedStyle(each).backgroundColor;
  while (ground.parentElement && /^rgba.*, 0\\)$|transparent/.test(seen(ground))) ground = ground.parentElement;
  const inSvg = element.namespaceURI.endsWith("svg");
  const behind = inSvg ? getComputedStyle(document.querySelector(".rim")).fill : seen(ground);
  return [[element.textContent.trim().slice(0, 40), inSvg ? style.fill : style.color, behind]];
})"""


def texts(page: Page) -> list[tuple[str, str, str]]:
    """Return each text that is shown, cut short, with its colour and that of its ground."""
    found: list[tuple[str, str, str]] = page.evaluate(_TEXTS)
    return found


def weak_texts(page: Page) -> list[str]:
    """Return the texts whose contrast is below AAA, each with its ratio."""
    weak = []
    for text, ink, ground in texts(page):
        if (found := contrast(_hex(ink), _hex(ground))) < AAA:
            weak.append(f"{text}: {found:.1f} ({ink} on {ground})")
    return weak


def _hex(css: str) -> str:
    """Return ``rgb(1, 2, 3)`` as ``#010203``."""
    return "#" + "".join(f"{round(float(part)):02x}" for part in css[css.index("(") + 1 : -1].split(",")[:3])
