"""Links between pages lead somewhere, on a plain Git host too; the index names every page of docs/ once, by kind."""

import re

import pytest

from host.tests.docs.page_blocks import ROOT, pages

LINK = re.compile(r"\[[^\]]*\]\(([^)#\s]*)(?:#([^)\s]*))?\)")
FENCE = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)
OUTSIDE = ("http://", "https://", "mailto:")


def anchors(text: str) -> set[str]:
    """As GitHub and MkDocs make them of headings."""
    titles = [re.sub(r"[^\w\s-]", "", title.lower()).strip() for title in HEADING.findall(FENCE.sub("", text))]
    return {re.sub(r"\s+", "-", title) for title in titles}


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page):
    text = page.read_text()
    for target, anchor in LINK.findall(FENCE.sub("", text)):
        if target.startswith(OUTSIDE):
            continue
        to = (page.parent / target).resolve() if target else page
        assert to.exists(), f"{page}: {target}"
        assert to.is_relative_to(ROOT)
        if anchor:
            assert anchor in anchors(to.read_text()), f"{page}: {target}#{anchor}"


def test_the_index_has_four_kinds_and_every_page_once():
    text = (ROOT / "docs" / "README.md").read_text()
    assert re.findall(r"^## (.+)$", text, re.MULTILINE) == ["Tutorials", "How-to", "Reference", "Explanation"]
    rows = re.findall(r"^\| \[[^\]]*\]\(([^)]+)\)", text, re.MULTILINE)
    assert len(rows) == len(set(rows))
    written = {path.name for path in (ROOT / "docs").glob("*.md")} - {"README.md"}
    assert {row for row in rows if "/" not in row} == written
