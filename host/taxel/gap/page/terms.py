"""Definitions of terms, copied from the glossary of the documentation by tools/codegen/page_terms.py."""

import re
import tomllib
from functools import cache

from taxel.gap.page.rendering import read_resource


@cache
def read_definitions() -> dict[str, str]:
    """Definitions by term, in alphabetical order."""
    entries = tomllib.loads(read_resource("terms.toml"))["term"]
    return {entry["name"]: entry["definition"] for entry in entries}


def make_anchor(name: str) -> str:
    """The anchor of a term in the section of terms. Raises KeyError for a term without a definition."""
    if name not in read_definitions():
        raise KeyError(name)
    return f"term-{re.sub('[^a-z]+', '-', name.lower())}"
