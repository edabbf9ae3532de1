"""Copy the terms that the page of a gap report explains from docs/glossary.md to host/taxel/gap/page/terms.toml.

python tools/codegen/page_terms.py            write the file
python tools/codegen/page_terms.py --check    exit status 1 if the file differs from the glossary
"""

import argparse
import json
import re
import sys
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
GLOSSARY: Final = ROOT / "docs" / "glossary.md"
TERMS: Final = ROOT / "host" / "taxel" / "gap" / "page" / "terms.toml"

PAGE_TERMS: Final = (
    *("approach", "board", "catalogue", "condition", "confounded effects", "effect", "excess", "floor", "gap"),
    *("held-out data", "identifiability", "phase", "repeat", "RX line, TX line", "session", "shrink"),
    *("signal", "signature", "taxel", "verdict"),
)
"""Headings of the glossary, in its order."""


def read_definitions(text: str) -> dict[str, str]:
    """Return the definition of each term of a glossary page without its links, by term. text: the page as Markdown."""
    sections = re.findall(r"^## ([^\n]+)\n\n(.+?)\n*(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    return {term: re.sub(r"\[([^]]+)\]\([^)]+\)", r"\1", " ".join(body.split())) for term, body in sections}


def format_terms(definitions: dict[str, str]) -> str:
    """Return the content of terms.toml. Raises KeyError for a term that the glossary lacks."""
    entries = (
        f"\n[[term]]\nname = {json.dumps(term)}\ndefinition = {json.dumps(definitions[term], ensure_ascii=False)}\n"
        for term in PAGE_TERMS
    )
    return "# Written by tools/codegen/page_terms.py from docs/glossary.md; do not edit.\n" + "".join(entries)


def main() -> int:
    """Write terms.toml, or with --check report whether it differs from the glossary; the exit status is then 1."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare only")
    arguments = parser.parse_args()
    content = format_terms(read_definitions(GLOSSARY.read_text(encoding="utf-8")))
    if not arguments.check:
        TERMS.write_text(content, encoding="utf-8")
    elif TERMS.read_text(encoding="utf-8") != content:
        print(f"{TERMS.relative_to(ROOT)}: differs from docs/glossary.md; run python tools/codegen/page_terms.py")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
