"""The mapping of an import: which fields of the files are times, values and labels (docs/import-any-data.md).

A mapping is a TOML file with ``format = "taxel-import-map"`` and ``version = 1``, or a `Mapping` of a program.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, Final

from taxel.hand.errors import format_value
from taxel.input_files import TextError, parse_toml, read_regular_file
from taxel.input_files.toml_text import TOML_BYTES_MAX
from taxel.recording.general.checks import check_properties
from taxel.recording.general.format import MODALITIES, Direction, Properties
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import REAL, SIM
from taxel.recording.importers.mapping_table import MappingTable
from taxel.recording.importers.places import Grid
from taxel.recording.importers.sources import check_input

FORMAT: Final = "taxel-import-map"
VERSION: Final = 1

TIME_UNITS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Length of each time unit in seconds."""

ORDERS: Final = ("taxel", "component")
"""Order of the values of vector taxels in a frame: x y z of the first taxel first, or x of all taxels first."""


@dataclass(frozen=True)
class Selection:
    """Fields of a file, or columns of a table, whose numbers are joined in the order of the taxels.

    Exactly one of names, prefix and span is set. names: names of the fields. prefix: common start of the names; the
    remainder of each name is a number, which gives the order. span: first and last column of a table. elements: indices
    of the numbers that are used in each joined frame; None: all. location: the table of the mapping file, for errors.
    """

    location: Location
    names: tuple[str, ...] | None = None
    prefix: str | None = None
    span: tuple[str, str] | None = None
    elements: tuple[int, ...] | None = None


@dataclass(frozen=True)
class Values:
    """Selection and shape of the taxel values.

    components: count of numbers for each taxel, 1 or 3. order: one of `ORDERS`. shape: expected shape of a frame,
    without components; None: not checked. frame_axis: axis of the frames in the array.
    """

    selection: Selection
    components: int = 1
    order: str = "taxel"
    shape: tuple[int, ...] | None = None
    frame_axis: int = 0


@dataclass(frozen=True)
class Times:
    """Times of the frames: the name of a field and its unit (key of `TIME_UNITS`), or a constant rate in hertz."""

    name: str | None = None
    unit: str = "s"
    rate_hz: float | None = None


@dataclass(frozen=True)
class Labels:
    """Labels of all contacts of a file: number of the session, names of object and approach; None: not given."""

    session: int | None = None
    object: str | None = None
    approach: str | None = None

    def merge(self, other: Labels) -> Labels:
        """Return the labels of `other`, completed by these labels where `other` has None."""
        entries = {name: getattr(other, name) for name in vars(other)}
        return Labels(**{name: getattr(self, name) if value is None else value for name, value in entries.items()})


@dataclass(frozen=True)
class Grouping:
    """Rule that divides the frames of a file into contacts.

    name: field with the number or name of the contact. gap_s: pause that starts a new contact, seconds. Neither: one
    contact for each file. axis: whether the first axis of all arrays is the contact and the second the frame.
    skip_short: leave out contacts with too few frames instead of refusing the file.
    """

    name: str | None = None
    gap_s: float | None = None
    axis: bool = False
    skip_short: bool = False


@dataclass(frozen=True)
class Mapping:
    """Rule that converts the fields of files to contacts; docs/import-any-data.md describes the keys of the file.

    label_fields: name of the field that contains a label, by the name of the label. phase, valid, position: names of
    fields. taxels: numbers of the taxels ("sensor", "tx", "rx"), or the name of their field. files: (pattern of file
    names, labels of the matching files).
    """

    source: str
    times: Times
    values: Values
    sensor: str = "sensor"
    properties: Properties = field(default_factory=Properties)
    grouping: Grouping = field(default_factory=Grouping)
    labels: Labels = field(default_factory=Labels)
    label_fields: dict[str, str] = field(default_factory=dict)
    phase: str | None = None
    valid: str | None = None
    force: Selection | None = None
    separation: Selection | None = None
    grid: Grid | None = None
    position: str | None = None
    position_unit: str = "m"
    taxels: dict[str, str | tuple[int, ...]] = field(default_factory=dict)
    files: tuple[tuple[str, Labels], ...] = ()

    def find_labels(self, path: Path) -> Labels:
        """Return the constant labels of a file: labels of the patterns in `files` that match, else of the mapping.

        If several matching patterns state a label, the last of these patterns determines the label.
        """
        labels = self.labels
        for pattern, labels_of_pattern in self.files:
            if fnmatch(path.name, pattern) or fnmatch(str(path), pattern):
                labels = labels.merge(labels_of_pattern)
        return labels


def load_mapping(path: str | os.PathLike[str]) -> Mapping:
    """Read a mapping file. Raises DatasetError, one line that names the file and the key, for the first error."""
    location = Location(os.fspath(path))
    check_input(Path(path))
    try:
        values = parse_toml(read_regular_file(path, TOML_BYTES_MAX))
    except TextError as error:
        location.key(error.position).fail(error.expected, format_value(error.found), "correct the syntax")
    except OSError as error:
        location.fail("a readable file", error.strerror or type(error).__name__, "check the path")
    return parse_mapping(values, location)


def parse_mapping(values: dict[str, Any], location: Location) -> Mapping:
    """Convert the content of a mapping file to a `Mapping`. Raises DatasetError for the first error.

    values: content of the TOML file. location: the file, for error messages.
    """
    table = MappingTable(values, location)
    remedy = "taxel import inspect FILE writes a mapping to start from"
    for name, expected in (("format", FORMAT), ("version", VERSION)):
        found = table.require(name, type(expected), remedy)
        if found != expected:
            location.key(name).fail(format_value(expected), format_value(found), remedy)
    source = table.take_choice("source", (REAL, SIM)) or location.key("source").fail(
        '"real" or "sim"', "nothing", "state whether the data were measured or simulated"
    )
    properties = Properties(
        table.take("unit", str),
        table.take_choice("contact", tuple(Direction)),
        table.take("full_scale", float),
        table.take("resolution", float),
        table.take_choice("modality", MODALITIES),
    )
    check_properties(properties, location)
    labels, label_fields = _parse_labels(table)
    grid, position, position_unit = _parse_positions(table)
    mapping = Mapping(
        source=source,
        times=_parse_times(table),
        values=_parse_values(table),
        sensor=table.take("sensor", str, "sensor") or "sensor",
        properties=properties,
        grouping=_parse_grouping(table),
        labels=labels,
        label_fields=label_fields,
        phase=table.take("phase", str),
        valid=table.take("valid", str),
        force=_parse_selection(table, "force"),
        separation=_parse_selection(table, "separation"),
        grid=grid,
        position=position,
        position_unit=position_unit,
        taxels=_parse_taxels(table),
        files=_parse_files(table),
    )
    table.finish()
    if (mapping.force is None) != (mapping.separation is None):
        location.key("force").fail("both force and separation, or neither", "one of them", "add the other one")
    return mapping


def _take_subtable(table: MappingTable, name: str, short: str = "field") -> MappingTable | None:
    """Remove a subtable from a table and return it; None if it is absent.

    short: key of the subtable whose value may stand for the whole subtable: time = "t" means time = {field = "t"}.
    Raises DatasetError for a value that is neither a table nor a string.
    """
    value = table.take_any(name)
    if value is None:
        return None
    location = table.location.key(name)
    if isinstance(value, str):
        value = {short: value}
    if not isinstance(value, dict):
        location.fail(f"a table, or the name of a {short}", format_value(value), "correct the value")
    return MappingTable(value, location)


def _parse_selection(table: MappingTable, name: str) -> Selection | None:
    """Take the subtable `name` as a selection; None if it is absent. Raises DatasetError for wrong or unknown keys."""
    subtable = _take_subtable(table, name)
    if subtable is None:
        return None
    selection = _take_selection(subtable)
    subtable.finish()
    return selection


def _take_selection(table: MappingTable) -> Selection:
    """Take the keys field, fields, columns, prefix, range and elements of a table. Raises DatasetError."""
    field_name, prefix = table.take("field", str), table.take("prefix", str)
    names = table.take_names("fields") or table.take_names("columns")
    span = table.take_names("range")
    elements = table.take_integers("elements", length=2)
    given = [value for value in (field_name, names, prefix, span) if value is not None]
    if len(given) != 1:
        found = "none" if not given else "several"
        table.location.fail("one of the keys field, fields, columns, prefix, range", found, "select the values once")
    if span is not None and len(span) != 2:
        table.location.key("range").fail("the first and the last column", f"{len(span)} names", "correct the list")
    if elements is not None and elements[1] < elements[0]:
        table.location.key("elements").fail("first and last number", repr(list(elements)), "exchange the numbers")
    return Selection(
        table.location,
        names=(field_name,) if field_name is not None else names,
        prefix=prefix,
        span=(span[0], span[1]) if span is not None else None,
        elements=None if elements is None else tuple(range(elements[0], elements[1] + 1)),
    )


def _parse_values(table: MappingTable) -> Values:
    """Take the required table [values]: selection and shape of the taxel values. Raises DatasetError."""
    subtable = _take_subtable(table, "values") or table.location.key("values").fail(
        "a table", "nothing", "select the values"
    )
    selection = _take_selection(subtable)
    components = subtable.take("components", int, 1)
    if components not in (1, 3):
        subtable.location.key("components").fail("1 or 3", format_value(components), "correct the value")
    order = subtable.take_choice("order", ORDERS, ORDERS[0])
    shape, axis = subtable.take_integers("shape", least=1), subtable.take("frame_axis", int, 0)
    subtable.finish()
    return Values(selection, int(components), str(order), shape, int(axis or 0))


def _parse_times(table: MappingTable) -> Times:
    """Take the required table [time]: either a field and its unit, or a rate. Raises DatasetError."""
    remedy = 'add [time] with field = "..." or rate_hz = 100.0'
    subtable = _take_subtable(table, "time") or table.location.key("time").fail("a table", "nothing", remedy)
    name, rate_hz = subtable.take("field", str), subtable.take("rate_hz", float)
    unit = subtable.take_choice("unit", tuple(TIME_UNITS), "s")
    subtable.finish()
    if (name is None) == (rate_hz is None):
        subtable.location.fail("either field or rate_hz", "neither" if name is None else "both", remedy)
    if rate_hz is not None and rate_hz <= 0:
        subtable.location.key("rate_hz").fail("a rate above 0 Hz", format_value(rate_hz), "correct the value")
    return Times(name, str(unit), rate_hz)


def _parse_grouping(table: MappingTable) -> Grouping:
    """Take the optional table [grasp], which divides the frames into contacts. Raises DatasetError for two rules."""
    subtable = _take_subtable(table, "grasp")
    if subtable is None:
        return Grouping()
    grouping = Grouping(
        subtable.take("field", str),
        subtable.take("gap_s", float),
        bool(subtable.take("axis", bool, False)),
        bool(subtable.take("skip_short", bool, False)),
    )
    subtable.finish()
    if sum((grouping.name is not None, grouping.gap_s is not None, grouping.axis)) > 1:
        subtable.location.fail("at most one of field, gap_s and axis", "several", "choose one rule")
    if grouping.gap_s is not None and grouping.gap_s <= 0:
        subtable.location.key("gap_s").fail("a pause above 0 s", format_value(grouping.gap_s), "correct the value")
    return grouping


def _parse_labels(table: MappingTable) -> tuple[Labels, dict[str, str]]:
    """Take session, object and approach: constants, or tables with the key field.

    Returns (constant labels, name of the field by the name of the label). Raises DatasetError.
    """
    constants: dict[str, Any] = {}
    label_fields: dict[str, str] = {}
    for name, kind in (("session", int), ("object", str), ("approach", str)):
        value = table.take_any(name)
        location = table.location.key(name)
        if isinstance(value, dict):
            subtable = MappingTable(value, location)
            label_fields[name] = subtable.require("field", str, "name the field with the label, or write a constant")
            subtable.finish()
        elif value is not None:
            constants[name] = _check_label(value, kind, location)
    return Labels(**constants), label_fields


def _check_label(value: Any, kind: type, location: Location) -> Any:
    """Return a constant label. Raises DatasetError for another type or a negative session."""
    is_wrong = type(value) is not kind or value == "" or (isinstance(value, int) and value < 0)
    if is_wrong:
        expected = "a number of 0 or more" if kind is int else "a string"
        location.fail(f"{expected}, or a table with the key field", format_value(value), "correct the value")
    return value


def _parse_files(table: MappingTable) -> tuple[tuple[str, Labels], ...]:
    """Take the list [[files]]; return (pattern of file names, labels of the matching files) for each entry.

    Raises DatasetError for an entry without a pattern, and for labels that are fields.
    """
    result = []
    for number, entry in enumerate(table.take("files", list, []) or []):
        location = table.location.key(f"files[{number}]")
        if not isinstance(entry, dict):
            location.fail("a table", format_value(entry), "write [[files]]")
        subtable = MappingTable(entry, location)
        pattern = subtable.require("pattern", str, 'write pattern = "day2_*.csv"')
        labels, label_fields = _parse_labels(subtable)
        subtable.finish()
        if label_fields:
            location.fail("constant labels", "a field", "write the constant, or move the field to the top of the file")
        result.append((pattern, labels))
    return tuple(result)


def _parse_positions(table: MappingTable) -> tuple[Grid | None, str | None, str]:
    """Take the positions of the taxels; return (grid or None, name of a field or None, unit "m" or "mm").

    At most one of grid and field is set; neither without the table [positions]. Raises DatasetError.
    """
    subtable = _take_subtable(table, "positions")
    if subtable is None:
        return None, None, "m"
    name, unit = subtable.take("field", str), subtable.take_choice("unit", ("m", "mm"), "m")
    rows, columns, pads = subtable.take("rows", int), subtable.take("columns", int), subtable.take("pads", int, 1)
    pitch_mm = subtable.take("pitch_mm", float)
    subtable.finish()
    if name is not None and (rows, columns, pitch_mm) == (None, None, None):
        return None, name, str(unit)
    location = subtable.location
    if name is not None or rows is None or columns is None or pitch_mm is None:
        location.fail("either field, or rows, columns and pitch_mm", "another selection", "correct the keys")
    if rows < 1 or columns < 1 or not pads or pads < 1 or pitch_mm <= 0:
        location.fail("numbers above 0", f"rows {rows}, columns {columns}, pitch_mm {pitch_mm}", "correct them")
    return Grid(rows, columns, pitch_mm * 1e-3, pads), None, "m"


def _parse_taxels(table: MappingTable) -> dict[str, str | tuple[int, ...]]:
    """Take the sensor, TX and RX numbers of the taxels: a list, or the name of a field, by "sensor", "tx" or "rx"."""
    subtable = _take_subtable(table, "taxels", "sensor")
    if subtable is None:
        return {}
    result: dict[str, str | tuple[int, ...]] = {}
    for name in ("sensor", "tx", "rx"):
        value = subtable.take_any(name)
        if isinstance(value, str):
            result[name] = value
        elif value is not None:
            reader = MappingTable({name: value}, subtable.location)
            result[name] = reader.take_integers(name) or ()
    subtable.finish()
    return result
