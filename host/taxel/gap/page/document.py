"""The page of a gap report: one file that needs nothing else, reads without scripts, and prints."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from taxel.gap.page.breakdown import ablation_section, parts_section, thesis_section
from taxel.gap.page.colours import DARK, LIGHT, ramp_css
from taxel.gap.page.effects import effects_section
from taxel.gap.page.figures import figures_section
from taxel.gap.page.hand import hand_section
from taxel.gap.page.header import header
from taxel.gap.page.inputs import inputs_section
from taxel.gap.page.remainder import confounded_section, next_section, unexplained_section
from taxel.gap.page.report import Report
from taxel.gap.page.tables import Section
from taxel.gap.page.text import escaped
from taxel.gap.page.unrolled import shape_css
from taxel.gap.page.waterfall import waterfall_section
from taxel.gap.page.where import where_section

_SECTIONS: tuple[Callable[[Report], Section | None], ...] = (
    figures_section,
    hand_section,
    waterfall_section,
    where_section,
    effects_section,
    confounded_section,
    unexplained_section,
    next_section,
    ablation_section,
    parts_section,
    thesis_section,
    inputs_section,
)

# Nothing may be fetched or run, whatever a report's text says.
_POLICY = "default-src 'none'; style-src 'unsafe-inline'"


def write_page(report: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Write the page of a report; the same report gives the same bytes.

    Args:
        report: as `json.load` gives `report.json`.
        path: the file to write; one that stands there is replaced only once the page is whole.

    Raises:
        GapInputError: a field is missing or malformed; nothing is written then.
        OSError: the file cannot be written.
    """
    data = page_text(report).encode()
    target = Path(path)
    part = target.with_name(f".{target.name}.part")
    try:
        part.write_bytes(data)
        os.replace(part, target)
    except OSError:
        part.unlink(missing_ok=True)
        raise


def page_text(report: Mapping[str, Any]) -> str:
    """The page as text: HTML that is well-formed XML too. Raises GapInputError as `write_page` does."""
    checked = Report(report)
    sections = [section for make in _SECTIONS if (section := make(checked)) is not None]
    title = escaped(f"Gap report: {checked.verdict.text('one_line')}")
    body = "".join(section.html() for section in sections)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8"/>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{escaped(_POLICY)}"/>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>\n'
        f'<meta name="color-scheme" content="light dark"/>\n<title>{title}</title>\n<style>\n{_style()}</style>\n'
        f"</head>\n<body>\n{header(checked, sections)}<main>\n{body}</main>\n</body>\n</html>\n"
    )


@cache
def _style() -> str:
    own = resources.files(__package__).joinpath("page.css").read_text(encoding="utf-8")
    dark = f"@media screen and (prefers-color-scheme: dark) {{ :root {{ {ramp_css(DARK)} }} }}"
    return f":root {{ {ramp_css(LIGHT)} }}\n{dark}\n{shape_css()}\n{own}"
