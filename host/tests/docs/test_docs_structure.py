"""Structure of the pages: sections of the how-to guides, and links to the glossary."""

import re

import pytest

from host.tests.docs.page_blocks import ROOT

DOCS = ROOT / "docs"
SECTIONS = ["Goal", "Steps", "Expected output", "Possible failures"]
GUIDES = [*sorted(DOCS.glob("how-to-*.md")), *sorted(DOCS.glob("tutorial-*.md"))]
GUIDES += [DOCS / "generate.md", DOCS / "grasp-campaign.md"]

NOT_PROSE = re.compile(r"^```.*?^```|`[^`\n]*`|!?\[[^\]]*\]\([^)]*\)|^#[^\n]*|<!--.*?-->", re.DOTALL | re.MULTILINE)
PAGES_WITHOUT_LINKS = {
    "README.md": "the index",
    "benchmarks.md": "most terms occur only in the names of figures",
    "cloud-libraries.md": "about libraries, not about the skin",
    "glossary.md": "the glossary",
    "blind-check.md": "most terms occur only in the names of figures",
}
"""Pages that are not checked for links to the glossary, with the reason."""

UNAMBIGUOUS_TERMS = (
    "baseline",
    "blind check",
    "compact frame",
    "contact cloud",
    "grasp dataset",
    "hand description",
    "indentation",
    "poll cycle",
    "raw count",
    "taxel",
    "verdict",
    "virtual time",
    "world file",
)
"""Terms of the glossary that have no other meaning on the pages."""


@pytest.mark.parametrize("guide", GUIDES, ids=lambda page: page.name)
def test_guide_has_the_four_sections_in_their_order(guide):
    headings = re.findall(r"^## (.+)$", guide.read_text(), re.MULTILINE)
    assert [heading for heading in headings if heading in SECTIONS] == SECTIONS


PAGES = [page for page in sorted(DOCS.glob("*.md")) if page.name not in PAGES_WITHOUT_LINKS]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_page_links_the_terms_that_it_uses_to_the_glossary(page):
    text = page.read_text()
    prose = NOT_PROSE.sub("", text)
    missing = [
        term
        for term in UNAMBIGUOUS_TERMS
        if re.search(rf"(?<![\w/.-]){term}s?(?![\w/-])", prose, re.IGNORECASE)
        and f"glossary.md#{term.replace(' ', '-')})" not in text
    ]
    assert not missing, f"docs/{page.name}: link the first use of each term to glossary.md#TERM"
