"""The page's own elements beside those of `taxel.gap.page.tables`."""

from __future__ import annotations

from taxel.gap.page.text import ABSENT, SPACE, escaped

_SHORT = 12  # characters that are not broken over lines


def scrolled(inner: str, name: str) -> str:
    """What may be wider than a narrow window. name: for people who hear the page or use its keyboard."""
    return f'<div class="scroll" role="region" aria-label="{name}" tabindex="0">{inner}</div>'


def place_words(place: str) -> str:
    """A place such as "TX 3, RX 2", escaped, that breaks at its commas."""
    parts = [escaped(part) for part in place.split(",")]
    return ", ".join(part.replace(" ", SPACE) if len(part) <= _SHORT else part for part in parts) or ABSENT


def placed(place: str) -> str:
    """A place within a sentence, set off; empty where the whole device is meant."""
    return f' <span class="place">{escaped(place)}</span>' if place.strip() else ""
