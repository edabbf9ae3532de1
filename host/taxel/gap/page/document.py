"""The page of a gap report: one HTML file without scripts and without external resources, which can be printed."""

import os
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

from taxel.gap.page.action_section import build_action_section
from taxel.gap.page.breakdown_sections import build_ablation_section, build_parts_section, build_thesis_section
from taxel.gap.page.cells import SectionData
from taxel.gap.page.certainty_section import build_certainty_section
from taxel.gap.page.colours import DARK, LIGHT, format_ramp_css, format_step_css
from taxel.gap.page.effects_section import build_effects_section
from taxel.gap.page.figures_section import build_figures_section
from taxel.gap.page.hand_section import build_hand_section
from taxel.gap.page.header_section import build_header_context
from taxel.gap.page.inputs_section import build_inputs_section
from taxel.gap.page.location_section import build_location_section
from taxel.gap.page.remainder_sections import build_unexplained_section
from taxel.gap.page.rendering import read_resource, render
from taxel.gap.page.resimulated_section import build_resimulated_section
from taxel.gap.page.term_links import link_terms
from taxel.gap.page.terms_section import build_terms_section
from taxel.gap.page.text import clean_text
from taxel.gap.page.waterfall_section import build_waterfall_section
from taxel.gap.report.checked_report import CheckedReport
from taxel.output import write_whole

Build = Callable[[CheckedReport], SectionData | None]

_SECTIONS: tuple[Build, ...] = (
    build_action_section,
    build_hand_section,
    build_certainty_section,
    build_figures_section,
    build_terms_section,
    build_inputs_section,
)

_FIGURES: tuple[Build, ...] = (
    build_effects_section,
    build_waterfall_section,
    build_ablation_section,
    build_resimulated_section,
    build_location_section,
    build_unexplained_section,
    build_parts_section,
    build_thesis_section,
)
"""Sections within that of the figures."""

# The browser fetches and executes nothing, regardless of the texts in a report.
_POLICY = "default-src 'none'; style-src 'unsafe-inline'"


def write_page(report: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Write the page of a report; equal reports give equal bytes.

    Args:
        report: content of `report.json`, as `json.load` returns it.
        path: the file to write; an existing file is replaced only when the page is complete.

    Raises:
        GapInputError: a field is missing or malformed; nothing is written then.
        OutputError, OSError: the file cannot be written.
    """
    write_whole(path, page_text(report))


def page_text(report: Mapping[str, Any]) -> str:
    """Return the page of a report as HTML that is also well-formed XML. Raises GapInputError as `write_page` does."""
    checked = CheckedReport(report)
    header = build_header_context(checked)
    sections = []
    for section in _build_sections(_SECTIONS, checked):
        details = _build_sections(_FIGURES, checked) if section.anchor == "figures" else []
        sections.append(_render_section(section) | {"details": [_render_section(detail) for detail in details]})
    return render(
        "page.html",
        title=clean_text(f"{header['headline']} {header['kind']}"),
        policy=_POLICY,
        style=_get_style(),
        header=header | {"lead": link_terms(render("lead.html", header=header))},
        sections=sections,
    )


def _build_sections(builders: Sequence[Build], report: CheckedReport) -> list[SectionData]:
    """Return the sections of a report that have content. builders: functions that return a section or None."""
    return [section for build in builders if (section := build(report)) is not None]


def _render_section(section: SectionData) -> dict[str, Any]:
    """Return the variables of a section in the template of the page, with its content as HTML.

    Terms are linked to their definitions, except in the section of the definitions.
    """
    body = render(f"sections/{section.template}.html", section=section)
    linked = body if section.anchor == "terms" else link_terms(body)
    return {"anchor": section.anchor, "title": section.title, "body": linked}


@cache
def _get_style() -> str:
    """Return the style sheet of the page, with the colours of the pictures. Cached."""
    light = f":root {{ {format_ramp_css(LIGHT)} }}"
    dark = f"@media screen and (prefers-color-scheme: dark) {{ :root {{ {format_ramp_css(DARK)} }} }}"
    return f"{light}\n{dark}\n{format_step_css()}\n{read_resource('hand.css')}{read_resource('page.css')}"
