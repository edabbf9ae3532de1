"""Definitions of the terms on the page: those of the glossary of the documentation, and the effects."""

import re
import tomllib
from functools import cache

from taxel.gap.page.glossary import DESCRIPTIONS
from taxel.gap.page.rendering import read_resource


@cache
def read_definitions() -> dict[str, str]:
    """Return the definitions by term, in alphabetical order. Cached.

    The file terms.toml is copied from the glossary by tools/codegen/page_terms.py; the effects of the catalogue are
    defined by `DESCRIPTIONS`.
    """
    entries = {entry["name"]: entry["definition"] for entry in tomllib.loads(read_resource("terms.toml"))["term"]}
    effects = {name.replace("_", " "): text for name, text in DESCRIPTIONS.items() if name != "unknown"}
    return dict(sorted({**effects, **entries}.items(), key=lambda item: item[0].lower()))


def make_anchor(name: str) -> str:
    """Return the anchor of a term in the section of terms. Raises KeyError for a term without a definition."""
    if name not in read_definitions():
        raise KeyError(name)
    return f"term-{re.sub('[^a-z]+', '-', name.lower())}"
