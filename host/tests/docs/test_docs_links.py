"""Links between pages have existing targets inside the repository, and the index lists every page of docs/ once."""

import re

import pytest

from host.tests.docs.page_blocks import ROOT, list_pages

LINK = re.compile(r"\[[^\]]*\]\(([^)#\s]*)(?:#([^)\s]*))?\)")
FENCE = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)
EXTERNAL = ("http://", "https://", "mailto:")


def read_anchors(text: str) -> set[str]:
    """Return the anchors of the headings of a page, formed by the rule of GitHub and MkDocs."""
    titles = [re.sub(r"[^\w\s-]", "", title.lower()).strip() for title in HEADING.findall(FENCE.sub("", text))]
    return {re.sub(r"\s+", "-", title) for title in titles}


@pytest.mark.parametrize("page", list_pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_has_an_existing_target_and_anchor(page):
    text = page.read_text()
    for target, anchor in LINK.findall(FENCE.sub("", text)):
        if target.startswith(EXTERNAL):
            continue
        linked_page = (page.parent / target).resolve() if target else page
        assert linked_page.exists(), f"{page}: {target}"
        assert linked_page.is_relative_to(ROOT)
        if anchor:
            assert anchor in read_anchors(linked_page.read_text()), f"{page}: {target}#{anchor}"


def test_the_index_has_four_sections_and_lists_every_page_once():
    text = (ROOT / "docs" / "README.md").read_text()
    assert re.findall(r"^## (.+)$", text, re.MULTILINE) == ["Tutorials", "How-to", "Reference", "Explanation"]
    listed_pages = re.findall(r"^\| \[[^\]]*\]\(([^)]+)\)", text, re.MULTILINE)
    assert len(listed_pages) == len(set(listed_pages))
    existing_pages = {path.name for path in (ROOT / "docs").glob("*.md")} - {"README.md"}
    assert {page for page in listed_pages if "/" not in page} == existing_pages
