"""Links from the first use of each term in a section to its definition, with the definition as a tool tip."""

import html
import re
from collections.abc import Iterator
from functools import cache
from typing import Final

from taxel.gap.page.terms import make_anchor, read_definitions

EXCLUDED: Final = frozenset({"a", "code", "h1", "h2", "pre", "svg", "style", "title", "caption", "b"})
"""Elements whose text has no links: links, code and pictures, and texts of the report that stand out already."""

_SPELLINGS: Final = {"confounded effects": ("confounded",), "held-out data": ("held-out", "held out")}
"""Further spellings of terms."""

_TAG: Final = re.compile(r"<(/?)([a-zA-Z][a-zA-Z0-9]*)[^>]*?(/?)>")


def link_terms(markup: str) -> str:
    """Return well-formed markup in which the first use of each term is a link. Text inside `EXCLUDED` elements is
    unchanged.
    """
    linked: set[str] = set()
    return "".join(_link_text(text, linked) if is_text else text for text, is_text in _split(markup))


def _split(markup: str) -> Iterator[tuple[str, bool]]:
    """Yield the parts of markup, and whether a part is text in which terms are linked (neither a tag nor in an excluded
    element).
    """
    depth, position = 0, 0
    for tag in _TAG.finditer(markup):
        if tag.start() > position:
            yield markup[position : tag.start()], depth == 0
        is_end, name, is_empty = tag.groups()
        if name.lower() in EXCLUDED and not is_empty:
            depth += -1 if is_end else 1
        yield tag.group(), False
        position = tag.end()
    yield markup[position:], depth == 0


def _link_text(text: str, linked: set[str]) -> str:
    return _compile_pattern().sub(lambda match: _link(match.group(), linked), text)


def _link(words: str, linked: set[str]) -> str:
    """Return a link to the definition of the term with the spelling `words`; the words alone if the term is linked
    already.

    linked: terms with a link, to which the term is added.
    """
    term = _list_spellings()[_fold(words)]
    if term in linked:
        return words
    linked.add(term)
    definition = html.escape(read_definitions()[term], quote=True)
    return f'<a class="term" href="#{make_anchor(term)}" title="{definition}">{words}</a>'


def _fold(words: str) -> str:
    return " ".join(words.replace("\N{NO-BREAK SPACE}", " ").lower().split())


@cache
def _list_spellings() -> dict[str, str]:
    """Return the term of each spelling in lower case, with plurals. Cached."""
    spellings: dict[str, str] = {}
    for term in read_definitions():
        for name in (*term.split(", "), *_SPELLINGS.get(term, ())):
            for plural in ("", "s", "es"):
                spellings.setdefault(f"{name.lower()}{plural}", term)
    return spellings


@cache
def _compile_pattern() -> re.Pattern[str]:
    """Return a regular expression that matches any spelling of a term as a whole word, the longest first. Cached."""
    longest_first = sorted(_list_spellings(), key=len, reverse=True)
    # The conditions before and after the words exclude parts of longer or hyphenated words, of character references
    # such as &amp; and of file names such as report.json.
    words = "|".join(re.escape(name).replace(r"\ ", r"[\s\u00a0]+") for name in longest_first)
    return re.compile(rf"(?<![\w&#-])(?:{words})(?![\w;-]|\.\w)", re.IGNORECASE)
