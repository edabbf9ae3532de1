"""HTML elements as strings: escaped text, sections, tables, lists and the frame of a diagram.

Every `str` argument that is not escaped by a function of this module is HTML already.
"""

import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from taxel.gap.page.bars import HEIGHT
from taxel.gap.page.text import clean_text, make_readable


def escape_text(text: str) -> str:
    """Escape a text for HTML, on one line and without unprintable characters."""
    return html.escape(clean_text(text))


def escape_name(name: str) -> str:
    """Format a name with underscores as readable HTML: `dead_taxel` becomes "dead taxel"."""
    return html.escape(make_readable(name))


def render_diagram(shapes: str, height: int = HEIGHT) -> str:
    """Render the SVG element of a diagram in a table cell. shapes: SVG text. height: pixels."""
    return f'<svg class="bar" width="100%" height="{height}" aria-hidden="true">{shapes}</svg>'


@dataclass(frozen=True)
class Section:
    """A section of the page. title, body: HTML."""

    anchor: str
    title: str
    body: str

    def html(self) -> str:
        """Return the section of the page as an HTML element."""
        heading = f'<h2 id="{self.anchor}-title">{self.title}</h2>'
        return (
            f'<section id="{self.anchor}" aria-labelledby="{self.anchor}-title">\n{heading}\n{self.body}\n</section>\n'
        )


@dataclass(frozen=True)
class Column:
    """A table column. heading: HTML. kind: CSS class: "" text, "n" numbers, "pic" a diagram."""

    heading: str
    kind: str = ""


def render_table(columns: Sequence[Column], rows: Iterable[Sequence[str]], caption: str, kind: str = "") -> str:
    """Render the HTML table whose first column contains the names of the rows. rows: the HTML of each row, by column.

    caption: for screen readers, unless the class `kind` makes it visible.
    """
    head = "".join(f'<th scope="col"{_format_class(column.kind)}>{column.heading}</th>' for column in columns)
    body = "\n".join(_render_row(columns, row) for row in rows)
    return (
        f"<table{_format_class(kind)}><caption>{caption}</caption>\n<thead><tr>{head}</tr></thead>\n"
        f"<tbody>\n{body}\n</tbody></table>"
    )


def _render_row(columns: Sequence[Column], row: Sequence[str]) -> str:
    """Render the HTML table row; the first cell is its header. row: HTML content of the cells."""
    (name_column, name), *pairs = zip(columns, row, strict=True)
    values = "".join(f"<td{_format_class(column.kind)}>{content}</td>" for column, content in pairs)
    return f'<tr><th scope="row"{_format_class(name_column.kind)}>{name}</th>{values}</tr>'


def _format_class(kind: str) -> str:
    """Format the HTML attribute for a CSS class; empty text for the empty class."""
    return f' class="{kind}"' if kind else ""


def render_paragraph(text: str, kind: str = "") -> str:
    """Render the HTML paragraph. text: HTML; kind: CSS class."""
    return f"<p{_format_class(kind)}>{text}</p>"


def render_bullets(items: Iterable[str], kind: str = "", tag: str = "ul") -> str:
    """Render the HTML list. items: HTML of each item; kind: CSS class; tag: "ul" or "ol"."""
    return f"<{tag}{_format_class(kind)}>{''.join(f'<li>{item}</li>' for item in items)}</{tag}>"


def render_folded(summary: str, body: str) -> str:
    """Render the HTML of a block that a screen shows on demand and a print shows always.

    summary: HTML of its visible line.
    """
    return f"<details><summary>{summary}</summary>{body}</details>"
