"""Contrast of the text on a page, by the formula of WCAG 2.2: at least 7 to 1 can be read in sunlight (level AAA)."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
        if (found := ratio(_rgb(ink), _rgb(ground))) < AAA:
            weak.append(f"{text}: {found:.1f} ({ink} on {ground})")
    return weak


def ratio(one: tuple[float, ...], other: tuple[float, ...]) -> float:
    """Return the contrast ratio of two sRGB colours, each part in 0..255."""
    low, high = sorted((_luminance(one), _luminance(other)))
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: tuple[float, ...]) -> float:
    linear = [
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in (c / 255 for c in colour)
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _rgb(css: str) -> tuple[float, ...]:
    return tuple(float(part) for part in css[css.index("(") + 1 : -1].split(",")[:3])
