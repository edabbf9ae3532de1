"""HTML page of a test: one file without external references and scripts, suitable for printing."""

import os
from collections.abc import Sequence
from functools import cache
from importlib import resources

from taxel_tools.testing.drift import Change
from taxel_tools.testing.history import Summary
from taxel_tools.testing.page.earlier import render_earlier_section
from taxel_tools.testing.page.html_text import escape_text
from taxel_tools.testing.page.phases import render_phase_section, render_phases_section
from taxel_tools.testing.page.verdict import format_title, render_header
from taxel_tools.testing.record import TestRecord
from taxel_tools.testing.whole_file import write_whole

# The browser fetches and runs nothing, regardless of the text of the record.
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


def write_page(
    record: TestRecord,
    path: str | os.PathLike[str],
    changes: Sequence[Change] = (),
    earlier: Sequence[Summary] = (),
    overwrite: bool = False,
) -> None:
    """Write the HTML page of a test record completely or not at all.

    changes: result of `History.compare` for the record. earlier: result of `History.list_earlier` for its serial
    number, without the record itself. overwrite: whether an existing file may be replaced. Raises `ResultFileError`
    if the file exists or is not writable.
    """
    write_whole(path, render_page(record, changes, earlier).encode(), overwrite)


def render_page(record: TestRecord, changes: Sequence[Change] = (), earlier: Sequence[Summary] = ()) -> str:
    """Render the HTML page of a test record, which is also well-formed XML; equal records give equal text."""
    sections = [render_phases_section(record.phases)]
    sections += [render_phase_section(number, phase) for number, phase in enumerate(record.phases, start=1)]
    history = render_earlier_section(record.phases, changes, earlier)
    body = "".join(section.html() for section in [*sections, *([history] if history else [])])
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8"/>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{escape_text(_POLICY)}"/>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>\n'
        f'<meta name="color-scheme" content="light dark"/>\n<title>{format_title(record)}</title>\n'
        f"<style>\n{_read_style()}</style>\n</head>\n<body>\n{render_header(record)}<main>\n{body}</main>\n</body>\n</html>\n"
    )


@cache
def _read_style() -> str:
    """Read the CSS style sheet of the page."""
    return resources.files(__package__).joinpath("page.css").read_text(encoding="utf-8")
