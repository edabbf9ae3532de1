"""Boxes, arrows and texts of an SVG drawing that is legible on a light and on a dark page."""

from typing import Final
from xml.sax.saxutils import escape

STYLE: Final = """
text { font-family: system-ui, -apple-system, "Segoe UI", "DejaVu Sans", Arial, sans-serif; fill: #1f2328; }
.name { font-size: 15px; font-weight: 600; }
.note { font-size: 13px; }
.label { font-size: 13px; font-style: italic; fill: #4d5761; }
.title { font-size: 13px; font-weight: 600; fill: #4d5761; }
.page { fill: #ffffff; stroke: #d0d7de; }
.box { fill: #ffffff; stroke: #57606a; stroke-width: 1.3; }
.group { stroke: none; }
.blue { fill: #e3eefb; }
.green { fill: #e2f3e6; }
.orange { fill: #fbeedd; }
.violet { fill: #efe7fb; }
.arrow { stroke: #57606a; stroke-width: 1.7; fill: none; }
.head { fill: #57606a; stroke: none; }
@media (prefers-color-scheme: dark) {
  text { fill: #e6edf3; }
  .label, .title { fill: #aab4be; }
  .page { fill: #0d1117; stroke: #3d444d; }
  .box { fill: #161b22; stroke: #9198a1; }
  .blue { fill: #12263f; }
  .green { fill: #12301c; }
  .orange { fill: #3a2810; }
  .violet { fill: #2a1d42; }
  .arrow { stroke: #9198a1; }
  .head { fill: #9198a1; }
}
"""
"""Colours of the light theme, then those of the dark theme. Every drawing has its own background."""

CHARACTER_PX: Final = {"name": 9.0, "note": 7.2, "label": 7.2, "title": 8.0}
"""Upper bound of the mean width of a character in each text class, pixels. Measured with DejaVu Sans."""

PADDING_PX: Final = 10
"""Smallest distance between a text and the side of its box."""


class Drawing:
    """An SVG drawing. All coordinates are pixels from the upper left corner.

    Raises `ValueError` for a text that is wider than its box.
    """

    def __init__(self, width: int, height: int, description: str) -> None:
        """Create an empty SVG drawing.

        width, height: pixels. description: text for readers who do not see the drawing.
        """
        self.width, self.height = width, height
        self._parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" role="img">',
            f"<title>{escape(description)}</title>",
            f"<style>{STYLE}</style>",
            '<defs><marker id="head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" '
            'orient="auto"><path class="head" d="M 0 0 L 10 5 L 0 10 z"/></marker></defs>',
            f'<rect class="page" x="0.5" y="0.5" width="{width - 1}" height="{height - 1}" rx="8"/>',
        ]

    def draw_group(self, x: int, y: int, width: int, height: int, colour: str, title: str) -> None:
        """Draw a coloured area with a title in its upper left corner."""
        self._draw_rectangle(f"group {colour}", x, y, width, height)
        self.draw_text("title", x + PADDING_PX, y + 20, title, width - 2 * PADDING_PX)

    def draw_box(self, x: int, y: int, width: int, height: int, name: str, note: str = "") -> None:
        """Draw a box with a centred name and, below it, a centred note."""
        self._draw_rectangle("box", x, y, width, height)
        space, middle = width - 2 * PADDING_PX, y + height / 2
        if note:
            self.draw_text("name", x + width / 2, middle - 4, name, space, is_centred=True)
            self.draw_text("note", x + width / 2, middle + 15, note, space, is_centred=True)
        else:
            self.draw_text("name", x + width / 2, middle + 5, name, space, is_centred=True)

    def draw_arrow(self, *points: tuple[float, float]) -> None:
        """Draw a line through the points, with a head at the last point."""
        path = " L ".join(f"{x:g} {y:g}" for x, y in points)
        self._parts.append(f'<path class="arrow" d="M {path}" marker-end="url(#head)"/>')

    def draw_text(self, kind: str, x: float, y: float, text: str, space: float, is_centred: bool = False) -> None:
        """Draw a text with its baseline at y.

        kind: CSS class. space: available width in pixels. Raises `ValueError` if the text is wider than the space.
        """
        if len(text) * CHARACTER_PX[kind] > space:
            raise ValueError(
                f"'{text}': expected at most {space / CHARACTER_PX[kind]:.0f} characters; shorten the text"
            )
        anchor = ' text-anchor="middle"' if is_centred else ""
        self._parts.append(f'<text class="{kind}" x="{x:g}" y="{y:g}"{anchor}>{escape(text)}</text>')

    def to_svg(self) -> str:
        """Return the text of the SVG file."""
        return "\n".join([*self._parts, "</svg>", ""])

    def _draw_rectangle(self, style: str, x: int, y: int, width: int, height: int) -> None:
        """Draw a rectangle with rounded corners. style: CSS class."""
        self._parts.append(f'<rect class="{style}" x="{x}" y="{y}" width="{width}" height="{height}" rx="6"/>')
