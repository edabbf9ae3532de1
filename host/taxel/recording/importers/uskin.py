"""XELA uSkin sensors: three values x, y, z of each taxel; x and y are shear, z is the normal direction.

Layouts and origins. The manufacturer publishes no CSV format: its server sends JSON with the values in the order x1,
y1, z1, x2, ... (README.md of o2as_xela_sensor in o2as/ur-o2as; README.md of penn-figueroa-lab/xela_setup), and each
laboratory writes its own table. Two layouts are accepted:

- columns with an axis and a number in their names, in any order: x0, y0, z0, ... or taxel_0_x, ... or X1, Y1, Z1, also
  several sets with different prefixes such as raw_x0 and d_x0, of which one is selected;
- a table without a header: 3 columns of each taxel in the order of the server, optionally after a column of times.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from taxel.hand.errors import format_value
from taxel.recording.general.format import AXES, Direction, GeneralHeader, Properties
from taxel.recording.importers.contacts import Recording
from taxel.recording.importers.fields import Source
from taxel.recording.importers.mapping import Selection, Times
from taxel.recording.importers.preset import PresetOptions, read_preset_times
from taxel.recording.importers.run import make_header
from taxel.recording.importers.selection import find_numbered, read_selection, read_times
from taxel.recording.importers.sources import open_source
from taxel.recording.importers.times import guess_unit, is_increasing
from taxel.types import FloatArray

_NAMES: Final = (
    re.compile(r"(?P<prefix>.*?)(?P<axis>[xyz])_?(?P<number>\d+)", re.IGNORECASE),
    re.compile(r"(?P<prefix>.*?)(?P<number>\d+)[_.]?(?P<axis>[xyz])", re.IGNORECASE),
)
_HEADERLESS: Final = "c"
"""Start of the names of columns without a header (`source_csv`)."""


def read_uskin(
    paths: Sequence[Path], source: str, options: PresetOptions, prefix: str | None = None, unit: str = "counts"
) -> tuple[GeneralHeader, list[Recording]]:
    """Read tables of uSkin sensors; return (header of the dataset, one recording for each table).

    source: "real" or "sim". prefix: common start of the column names to read, such as "raw_"; None: that of the first
    suitable columns. unit: unit of the values; the sensors give counts unless they are calibrated. Raises DatasetError
    for a table without three columns for each taxel.
    """
    recordings = []
    for path in paths:
        table = open_source(path)
        names = find_axes(table, prefix)
        time = None
        if not names:
            names, time = _find_headerless(table, options)
        if not names:
            found = "none" if prefix is None else f"none with the prefix {format_value(prefix)}"
            remedy = "rename the columns, or import the table with a mapping (taxel import inspect)"
            table.location.fail("columns x0, y0, z0, x1, ... for every taxel", found, remedy)
        flat = read_selection(table, Selection(table.at("columns"), names)).astype(np.float64)
        if time is None:
            time = read_preset_times(table, len(flat), options)
        values = flat.reshape(len(flat), len(names) // AXES, AXES)
        recordings.append(Recording(table.location, time, values, options.labels))
    properties = Properties(unit=unit, contact=Direction.SIGNED.value, modality="magnetic")
    return make_header(source, "uSkin", properties), recordings


def find_axes(table: Source, prefix: str | None) -> tuple[str, ...]:
    """Return the names of the columns: x, y, z of the first taxel, x, y, z of the second taxel, ...; empty if none.

    prefix: common start of the column names; None: the first prefix that three or more columns have. Raises
    DatasetError if a taxel lacks an axis.
    """
    groups: dict[str, dict[tuple[int, str], str]] = defaultdict(dict)
    for name in table.fields:
        match = next((match for pattern in _NAMES if (match := pattern.fullmatch(name))), None)
        if match is not None:
            groups[match["prefix"]][int(match["number"]), match["axis"].lower()] = name
    found = (
        groups.get(prefix)
        if prefix is not None
        else next((columns for columns in groups.values() if len(columns) >= AXES), None)
    )
    if not found:
        return ()
    for number in sorted({number for number, _ in found}):
        for axis in "xyz":
            if (number, axis) not in found:
                remedy = "add the column, or remove the other columns of that taxel"
                table.at(f"taxel {number}").fail("columns x, y and z", f"no column {axis}", remedy)
    return tuple(found[key] for key in sorted(found))


def _find_headerless(table: Source, options: PresetOptions) -> tuple[tuple[str, ...], FloatArray | None]:
    """Return (names of the value columns, times) of a table without a header.

    Three columns belong to each taxel. If there is one more column, the first one contains the times, f64[T], seconds
    from the first frame; else the times are None. The names are empty for a table with a header, or with two more
    columns. Raises DatasetError if the times do not increase.
    """
    names = find_numbered(table, _HEADERLESS)
    if len(names) != len(table.fields) or len(names) % AXES == 2:
        return (), None
    if len(names) % AXES == 0:
        return names, None
    first = table.read_numbers(names[0])
    if not is_increasing(first):
        table.at(names[0]).fail("increasing times in the first column", "others", "correct the table")
    unit = options.time_unit or guess_unit("", first)
    return names[1:], read_times(table, Times(names[0], unit), len(first))
