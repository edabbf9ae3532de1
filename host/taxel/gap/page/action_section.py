"""The recommended action on the page."""

from taxel.gap.page.action import recommend_action
from taxel.gap.page.cells import SectionData
from taxel.gap.page.remainder_sections import build_recommendation_table
from taxel.gap.report.checked_report import CheckedReport


def build_action_section(report: CheckedReport) -> SectionData:
    """Return the section "What to do", with a table of contacts if more than one contact is recommended. Raises
    GapInputError for a missing or malformed field.
    """
    action = recommend_action(report)
    table = build_recommendation_table(report) if action.next_contact else None
    has_more = table is not None and len(table.rows) > 1
    return SectionData("action", "What to do", "action", {"action": action, "contacts": table if has_more else None})
