"""Locations of the report as text: boards, lines, taxels, phases."""

from taxel.gap.page.text import SPACE, make_readable
from taxel.gap.report.checked_report import CheckedReport, get_address
from taxel.gap.report.report_values import ReportValue

_MAX_LINE = 255
_ADDRESS_KEYS = ("address", "sensor")
_MAX_LISTED = 12


def read_axis(entry: ReportValue) -> str:
    """Return the axis of a line, "tx" or "rx". Raises GapInputError for another value."""
    return entry.choice("axis", ("tx", "rx"))


def read_line(entry: ReportValue) -> tuple[int, str, int]:
    """Return address, axis and index of a line. Raises GapInputError for a missing or malformed field."""
    return get_address(entry), read_axis(entry), entry.field("index").as_integer(0, _MAX_LINE)


def format_board(report: CheckedReport, address: int) -> str:
    """Return a board as text: its name, or its address if the report has no name."""
    name = report.board_names.get(address)
    return make_readable(name) if name else f"board {_format_address(report, address)}"


def format_board_address(report: CheckedReport, address: int) -> str:
    """Return a board as text with name and bus address: "palm (0x20)"; without a name or a bus address as
    `format_board`.
    """
    name = report.board_names.get(address)
    if not name or not report.has_bus_addresses:
        return format_board(report, address)
    return f"{make_readable(name)}{SPACE}({_format_address(report, address)})"


def _format_address(report: CheckedReport, address: int) -> str:
    """Return an address as text: "0x20" if the addresses of the report are I2C addresses, otherwise "32"."""
    return f"0x{address:02X}" if report.has_bus_addresses else str(address)


def format_line(report: CheckedReport, line: tuple[int, str, int]) -> str:
    """Return a line (address, axis, index) as text, such as "palm, TX 3"."""
    address, axis, index = line
    return f"{format_board(report, address)}, {axis.upper()}{SPACE}{index}"


def format_taxel(report: CheckedReport, index: int) -> str:
    """Return a taxel as text: its board and lines; its index if the report has no taxel table or no electrode lines."""
    if report.taxels is None or index >= len(report.taxels[0]):
        return f"taxel {index}"
    address, tx, rx = (column[index] for column in report.taxels)
    if not report.has_lines:
        return f"{format_board(report, address)}, taxel {index}"
    return f"{format_board(report, address)}, TX{SPACE}{tx} RX{SPACE}{rx}"


def format_location(report: CheckedReport, location: ReportValue) -> str:
    """Return any location of the report as text. Raises GapInputError for a location without a known field.

    report: supplies the names of the boards and the lines of the taxels. location: a string, which is returned in
    readable form, or a table with some of the fields `address` or `sensor` (board), `axis` (of a line), `index` (of a
    line, or of a taxel in a table without `axis`), `phase`, `object`, `approach` and `name`.
    """
    if isinstance(location.content, str):
        return make_readable(location.content)
    texts = []
    table = location.table()
    for key in _ADDRESS_KEYS:
        if isinstance(table.get(key), int):
            texts.append(format_board(report, location.field(key).as_integer(0, 255)))
            break
        if isinstance(table.get(key), str):
            texts.append(make_readable(location.text(key)))
            break
    if "axis" in table:
        texts.append(f"{read_axis(location).upper()}{SPACE}{location.field('index').as_integer(0, _MAX_LINE)}")
    elif "index" in table:
        texts.append(format_taxel(report, location.field("index").as_integer(0, 2**20)))
    elif not texts and "name" in table:
        texts.append(make_readable(location.text("name")))
    texts += [
        make_readable(location.text(key)) for key in ("phase", "object", "approach") if isinstance(table.get(key), str)
    ]
    if not texts:
        location.reject("a string, or a table with address, axis and index, phase, object or name")
    return ", ".join(texts)


def format_effect_locations(report: CheckedReport, effect: ReportValue) -> str:
    """Return the locations of a local effect as text, at most `_MAX_LISTED`; empty if the effect acts everywhere."""
    where = effect.optional("where")
    if where is None:
        return ""
    texts = [_format_sensor(report, item) for item in where.optional_list("sensors")]
    texts += [_format_line_item(report, item) for item in where.optional_list("lines")]
    texts += [_format_taxel_item(report, item) for item in where.optional_list("taxels")]
    hidden = len(texts) - _MAX_LISTED
    return "; ".join([*texts[:_MAX_LISTED], *([f"{hidden} more"] if hidden > 0 else [])])


def _format_sensor(report: CheckedReport, item: ReportValue) -> str:
    """Return a board as text.

    report: supplies the name of a board by its address. item: the address of the board, or a location for
    `format_location`, such as a table with the field `address`. Raises GapInputError for a malformed item.
    """
    if isinstance(item.content, int):
        return format_board(report, item.as_integer(0, 255))
    return format_location(report, item)


def _format_line_item(report: CheckedReport, item: ReportValue) -> str:
    """Return a TX or RX line as text.

    report: supplies the name of a board by its address. item: a list of address, axis and index, or a location for
    `format_location`, such as a table with these fields. Raises GapInputError for a malformed item.
    """
    content = item.content
    if isinstance(content, list) and len(content) == 3:
        keys = ("address", "axis", "index")
        item = ReportValue(dict(zip(keys, content, strict=True)), item.path)
    return format_location(report, item)


def _format_taxel_item(report: CheckedReport, item: ReportValue) -> str:
    """Return a taxel as text: its board and its lines, which the taxel table of the report assigns to its index.

    report: supplies this table and the names of the boards. item: the index of the taxel in this table, or a location
    for `format_location`, such as a table with the field `index`. Raises GapInputError for a malformed item.
    """
    if isinstance(item.content, int):
        return format_taxel(report, item.as_integer(0, 2**20))
    return format_location(report, item)
