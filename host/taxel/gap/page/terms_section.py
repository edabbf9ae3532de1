"""Definitions of the terms on the page, so that the page can be read without the documentation."""

from taxel.gap.page.cells import SectionData
from taxel.gap.page.terms import make_anchor, read_definitions
from taxel.gap.report.checked_report import CheckedReport


def build_terms_section(_: CheckedReport) -> SectionData:
    """Return the section with the definitions of terms; it is the same for all reports."""
    terms = [
        {"name": name, "anchor": make_anchor(name), "definition": definition}
        for name, definition in read_definitions().items()
    ]
    return SectionData("terms", "Terms", "terms", {"terms": terms})
