"""Sections and tables of the page as data; the templates turn them into HTML."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from taxel.gap.page.bars import Bar
from taxel.gap.page.terms import make_anchor


@dataclass(frozen=True)
class SectionData:
    """A section of the page. anchor: name in links to it. template: name of its template without ".html". context:
    variables of the template.
    """

    anchor: str
    title: str
    template: str
    context: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Heading:
    """Heading of a column. kind: CSS class: "" text, "n" numbers, "pic" a diagram."""

    text: str
    kind: str = ""


@dataclass(frozen=True)
class Cell:
    """A table cell.

    text: plain text. note: explanation in a second line. bar: a diagram instead of the text. tag: a label after the
    text. has_dot: a dot after the text, which marks a small p-value. term: name of the term in the section Terms that
    the text links to.
    """

    text: str = ""
    note: str = ""
    bar: Bar | None = None
    tag: str = ""
    is_bold: bool = False
    is_small: bool = False
    has_dot: bool | None = None
    term: str = ""

    @property
    def anchor(self) -> str:
        """Anchor of the term; empty without a term."""
        return make_anchor(self.term) if self.term else ""


@dataclass(frozen=True)
class TableData:
    """A table whose first column contains the names of the rows.

    caption: for screen readers. kind: CSS class of the table.
    """

    headings: Sequence[Heading]
    rows: Sequence[Sequence[Cell]]
    caption: str
    kind: str = ""


CellContent = Cell | str | Bar | None


def make_table(
    headings: Sequence[Heading], rows: Iterable[Sequence[CellContent]], caption: str, kind: str = ""
) -> TableData:
    """Return a table from cells, texts and diagrams; None becomes an empty cell. caption: text for screen readers.
    kind: CSS class.
    """
    return TableData(headings, [[_as_cell(item) for item in row] for row in rows], caption, kind)


def _as_cell(item: CellContent) -> Cell:
    """Convert a text, a diagram or a cell to a cell; None becomes an empty cell."""
    if isinstance(item, Cell):
        return item
    if isinstance(item, Bar):
        return Cell(bar=item)
    return Cell(item or "")
