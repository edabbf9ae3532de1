"""docs/bring-up.md has a step for every point of the port that is not verified on hardware."""

import re

from host.tests.docs.page_blocks import ROOT

PAGE = (ROOT / "docs" / "bring-up.md").read_text(encoding="utf-8")
PORTS = [ROOT / "firmware" / "boards" / name for name in ("psoc4200", "psoc4")]
"""Folders of the port to the PSoC 4200: its own files, and those that it shares."""


def list_rows(text, heading):
    """List (first column, last column) of each row of the first table after the string `heading` in a page."""
    lines = text[text.index(heading) :].splitlines()
    begin = next(index for index, line in enumerate(lines) if line.startswith("|---"))
    rows = []
    for line in lines[begin + 1 :]:
        if not line.startswith("|"):
            break
        columns = [column.strip() for column in line.strip("|").split("|")]
        rows.append((columns[0], columns[-1]))
    return rows


def test_every_point_of_the_port_that_is_not_verified_has_a_step_in_the_same_order():
    port = (ROOT / "docs" / "psoc4200.md").read_text(encoding="utf-8")
    points = [point for point, _ in list_rows(port, "## Not verified on hardware")]
    steps = dict(list_rows(PAGE, "## Points and steps"))
    assert len(points) > 20  # the table was found and is not empty
    assert list(steps) == points


def test_every_file_of_the_port_with_a_confirm_mark_has_a_step():
    rows = list_rows(PAGE, 'The marks "(confirm)"')
    named_files = {name for names, _ in rows for name in re.findall(r"`([^`]+)`", names)}
    marked_files = {
        str(path.relative_to(port))
        for port in PORTS
        for path in port.rglob("*")
        if path.suffix in (".c", ".h", ".toml") and "confirm)" in path.read_text(encoding="utf-8")
    }
    assert marked_files <= named_files
    assert all(any((port / name).is_file() for port in PORTS) for name in named_files)


def test_tables_name_only_existing_steps_and_the_steps_are_numbered_without_gaps():
    steps = {int(number) for number in re.findall(r"^### Step (\d+):", PAGE, re.MULTILINE)}
    rows = list_rows(PAGE, "## Points and steps") + list_rows(PAGE, 'The marks "(confirm)"')
    used = {int(number) for _, numbers in rows for number in numbers.split(",")}
    assert used <= steps == set(range(1, 14))  # the page has 13 steps
