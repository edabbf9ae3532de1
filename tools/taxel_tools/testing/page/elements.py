"""Page elements in addition to those of `html_text.py`."""

from taxel.gap.page.text import ABSENT, SPACE
from taxel_tools.testing.page.html_text import escape_text

_UNBROKEN_LENGTH = 12  # Longest text without a line break.


def render_scrolled(inner: str, name: str) -> str:
    """Render the HTML of a scrollable region for wide content. name: label for screen readers and keyboard users."""
    return f'<div class="scroll" role="region" aria-label="{name}" tabindex="0">{inner}</div>'


def format_place(place: str) -> str:
    """Format the HTML text of a place such as "TX 3, RX 2", with line breaks only at its commas."""
    parts = [escape_text(part) for part in place.split(",")]
    return ", ".join(part.replace(" ", SPACE) if len(part) <= _UNBROKEN_LENGTH else part for part in parts) or ABSENT


def format_inline_place(place: str) -> str:
    """Format the HTML text of a place inside a sentence, such as " at TX 3"; empty for the whole device."""
    return f' <span class="place">{escape_text(place)}</span>' if place.strip() else ""
