"""The page's elements: sections and tables. All cells are HTML already; who makes one escapes what the file says."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Section:
    """A part of the page: the anchor, the title and the body."""

    anchor: str
    title: str
    body: str

    def html(self) -> str:
        """The section as an element."""
        heading = f'<h2 id="{self.anchor}-title">{self.title}</h2>'
        return (
            f'<section id="{self.anchor}" aria-labelledby="{self.anchor}-title">\n{heading}\n{self.body}\n</section>\n'
        )


@dataclass(frozen=True)
class Column:
    """A column: its heading and its class: "" words, "n" numbers, "pic" a picture."""

    heading: str
    kind: str = ""


def table(columns: Sequence[Column], rows: Iterable[Sequence[str]], caption: str, kind: str = "") -> str:
    """A table whose first column names the rows. `caption` is for people who hear the page, unless `kind` shows it."""
    head = "".join(f'<th scope="col"{_class(column.kind)}>{column.heading}</th>' for column in columns)
    body = "\n".join(_row(columns, row) for row in rows)
    return (
        f"<table{_class(kind)}><caption>{caption}</caption>\n<thead><tr>{head}</tr></thead>\n"
        f"<tbody>\n{body}\n</tbody></table>"
    )


def _row(columns: Sequence[Column], row: Sequence[str]) -> str:
    first, *others = zip(columns, row, strict=True)
    cells = "".join(f"<td{_class(column.kind)}>{cell}</td>" for column, cell in others)
    return f'<tr><th scope="row"{_class(first[0].kind)}>{first[1]}</th>{cells}</tr>'


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph."""
    return f"<p{_class(kind)}>{text}</p>"


def bullets(items: Iterable[str], kind: str = "", tag: str = "ul") -> str:
    """A list."""
    return f"<{tag}{_class(kind)}>{''.join(f'<li>{item}</li>' for item in items)}</{tag}>"


def folded(summary: str, body: str) -> str:
    """What is shown on demand, and on paper."""
    return f"<details><summary>{summary}</summary>{body}</details>"
