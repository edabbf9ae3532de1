"""Places of the report in words: boards, lines, taxels, phases."""

from __future__ import annotations

from taxel.gap.page.fields import Value
from taxel.gap.page.report import Report, address_of
from taxel.gap.page.text import SPACE, escaped, words

_MAX_LINE = 255
_ADDRESS_KEYS = ("address", "sensor")
_MAX_LISTED = 12


def axis_of(entry: Value) -> str:
    """The axis of a line: tx or rx."""
    return entry.one_of("axis", ("tx", "rx"))


def line_of(entry: Value) -> tuple[int, str, int]:
    """Address, axis and number of a line."""
    return address_of(entry), axis_of(entry), entry.field("index").as_integer(0, _MAX_LINE)


def line_words(report: Report, line: tuple[int, str, int]) -> str:
    """A line in words, escaped."""
    address, axis, index = line
    return f"{report.board(address)}, {axis.upper()}{SPACE}{index}"


def taxel_words(report: Report, index: int) -> str:
    """A taxel in words, escaped: by its board and lines where the report says them."""
    if report.taxels is None or index >= len(report.taxels[0]):
        return f"taxel {index}"
    address, tx, rx = (column[index] for column in report.taxels)
    return f"{report.board(address)}, TX{SPACE}{tx} RX{SPACE}{rx}"


def place_words(report: Report, place: Value) -> str:
    """Any place in words, escaped: a string as it is; a table by the fields of the lists under `where`."""
    if isinstance(place.content, str):
        return words(place.content)
    parts = []
    table = place.table()
    for key in _ADDRESS_KEYS:
        if isinstance(table.get(key), int):
            parts.append(report.board(place.field(key).as_integer(0, 255)))
            break
        if isinstance(table.get(key), str):
            parts.append(words(place.text(key)))
            break
    if "axis" in table:
        parts.append(f"{axis_of(place).upper()}{SPACE}{place.field('index').as_integer(0, _MAX_LINE)}")
    elif "index" in table:
        parts.append(taxel_words(report, place.field("index").as_integer(0, 2**20)))
    elif not parts and "name" in table:
        parts.append(words(place.text("name")))
    parts += [words(place.text(key)) for key in ("phase", "object", "approach") if isinstance(table.get(key), str)]
    if not parts:
        place.fail("a place: words, or a table with address, axis and index, phase, object or name")
    return ", ".join(parts)


def acts_on(report: Report, effect: Value) -> str:
    """Where a local effect acts, in words, escaped; empty if everywhere."""
    where = effect.maybe("where")
    if where is None:
        return ""
    found = [_sensor(report, item) for item in where.maybe_list("sensors")]
    found += [_line(report, item) for item in where.maybe_list("lines")]
    found += [_taxel(report, item) for item in where.maybe_list("taxels")]
    more = len(found) - _MAX_LISTED
    return "; ".join([*found[:_MAX_LISTED], *([escaped(f"{more} more")] if more > 0 else [])])


def _sensor(report: Report, item: Value) -> str:
    return report.board(item.as_integer(0, 255)) if isinstance(item.content, int) else place_words(report, item)


def _line(report: Report, item: Value) -> str:
    parts = item.content
    if isinstance(parts, list) and len(parts) == 3:
        keys = ("address", "axis", "index")
        item = Value(dict(zip(keys, parts, strict=True)), item.path)
    return place_words(report, item)


def _taxel(report: Report, item: Value) -> str:
    is_index = isinstance(item.content, int)
    return taxel_words(report, item.as_integer(0, 2**20)) if is_index else place_words(report, item)
