"""Robotiq TSF-85 fingertips: 28 taxels of each finger, 7 rows of 4, row by row.

Layouts and origins:

- simulation: the extension of Lab-CORO/TSF-85 (TSF_85_Ext/python/TSF_85_Ext/logging_data.py, class DataLogger) writes
  NAME_tactile_maps.csv with the columns time_sec, frame, pred_0 ... pred_27 for each pad; the example files are named
  TactileData_s1_tactile_maps.csv and TactileData_s2_tactile_maps.csv. The grid is from view_run.py of the same project.
- hardware: no file and no source of the recorder of the manufacturer is published. A table of the recorder is accepted
  if it has a column of times, and 28 or 56 columns of taxels: one or two sets of 28 numbered columns, or columns that
  the user names. The driver robotiq_tsf publishes uint16[28] for each of two fingers in the same order; contact raises
  the counts.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from taxel.recording.general.format import Direction, GeneralHeader, Properties, TaxelPlaces
from taxel.recording.grasp_format import REAL
from taxel.recording.importers.contacts import Recording
from taxel.recording.importers.fields import Source
from taxel.recording.importers.mapping import Selection
from taxel.recording.importers.preset import PresetOptions, read_preset_times
from taxel.recording.importers.run import make_header
from taxel.recording.importers.selection import read_selection
from taxel.recording.importers.sources import open_source
from taxel.types import FloatArray, IntArray

TAXELS: Final = 28
"""Number of taxels of a finger."""

_FRAME: Final = "frame"
_PAD: Final = re.compile(r"(?<![a-zA-Z0-9])s([12])(?![0-9])")
"""Part of a file name of the simulation that is the number of the pad."""


def read_tsf85(
    paths: Sequence[Path], source: str, options: PresetOptions, columns: tuple[str, str] | None = None
) -> tuple[GeneralHeader, list[Recording]]:
    """Read tables of the TSF-85; return (header of the dataset, recordings).

    Files whose names differ only in s1 and s2 are the two fingers of one recording.

    source: "real" or "sim". columns: first and last column of the taxels; None: found by their names. Raises
    DatasetError for a table without 28 or 56 columns of taxels, and for pairs without common frames.
    """
    groups: dict[str, list[Path]] = defaultdict(list)
    for path in paths:
        groups[str(path.with_name(_PAD.sub("s*", path.name)))].append(path)
    recordings = [_read_group(sorted(group, key=lambda path: path.name), options, columns) for group in groups.values()]
    fingers = recordings[0].values.shape[1] // TAXELS
    places = TaxelPlaces(sensor=np.repeat(np.arange(fingers), TAXELS))
    unit = "counts" if source == REAL else None
    properties = Properties(unit=unit, contact=Direction.RAISES.value, modality="capacitive")
    return make_header(source, "TSF-85", properties, places), recordings


def _read_group(paths: Sequence[Path], options: PresetOptions, columns: tuple[str, str] | None) -> Recording:
    """Read one file, or the files of both fingers, as one recording.

    Rows of both fingers with the same frame number are joined; other rows are left out. Raises DatasetError if no frame
    number is in both files.
    """
    tables = [open_source(path) for path in paths]
    values = [_read_taxels(table, columns) for table in tables]
    time = read_preset_times(tables[0], len(values[0]), options)
    if len(tables) > 1:
        numbers = [table.read_numbers(_FRAME).astype(np.int64) for table in tables]
        common = np.intersect1d(numbers[0], numbers[1])
        if not len(common):
            remedy = "give the files of one recording, or import the fingers separately"
            tables[1].at(_FRAME).fail(f"frames that are also in {paths[0].name}", "none", remedy)
        rows = [_find_rows(frame_numbers, common) for frame_numbers in numbers]
        values = [finger[index] for finger, index in zip(values, rows, strict=True)]
        time = time[rows[0]]
    return Recording(tables[0].location, time, np.concatenate(values, axis=1), options.labels)


def _find_rows(numbers: IntArray, common: IntArray) -> IntArray:
    """Return the index in `numbers` of the first occurrence of each frame number in `common`."""
    order = np.argsort(numbers, kind="stable")
    return np.asarray(order[np.searchsorted(numbers, common, sorter=order)])


def _read_taxels(table: Source, columns: tuple[str, str] | None) -> FloatArray:
    """Read the taxel values of a table, f64[T, 28] or f64[T, 56]. Raises DatasetError for another number of columns.

    columns: first and last column of the taxels; None: found by their names.
    """
    if columns is not None:
        selection = Selection(table.at("columns"), span=columns)
    else:
        names = [name for group in find_fingers(table) for name in group]
        if not names:
            expected = f"one or two sets of {TAXELS} numbered columns, such as pred_0 ... pred_27"
            remedy = "name the first and the last column of the taxels with --columns FIRST,LAST"
            table.location.fail(expected, "none", remedy)
        selection = Selection(table.at("columns"), tuple(names))
    values = np.asarray(read_selection(table, selection), np.float64)
    if values.shape[1] not in (TAXELS, 2 * TAXELS):
        table.at("columns").fail(f"{TAXELS} or {2 * TAXELS} columns", str(values.shape[1]), "correct them")
    return values


def find_fingers(table: Source) -> list[list[str]]:
    """Find the columns of the fingers: at most two lists of 28 names with one prefix and successive numbers.

    The lists are in the order of the table. If the first suitable prefix has 56 columns, which are those of both
    fingers, the result is one list of 56 names. Empty if the table has no such columns.
    """
    groups: dict[str, dict[int, str]] = defaultdict(dict)
    for name in table.fields:
        match = re.fullmatch(r"(.*?)(\d+)", name)
        if match is not None:
            groups[match[1]][int(match[2])] = name
    result = []
    for numbered in groups.values():
        numbers = sorted(numbered)
        if len(numbers) in (TAXELS, 2 * TAXELS) and numbers[-1] - numbers[0] == len(numbers) - 1:
            result.append([numbered[number] for number in numbers])
    if result and len(result[0]) == 2 * TAXELS:
        return result[:1]
    return [group for group in result if len(group) == TAXELS][:2]
