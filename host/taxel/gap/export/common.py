"""Inputs of an export: the effects of a report, the tables of its taxels, and the simulated dataset that it names."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Final

import numpy as np

from taxel.gap.apply.frames import FrameStates
from taxel.gap.apply.same_hand import check_hand
from taxel.gap.data.boards import BoardLayout, layouts_of
from taxel.gap.effects.effect import BOARD, TAXEL
from taxel.gap.effects.layer_law import Law, law_of
from taxel.gap.report.reading import ReportedEffect, ReportedGap, read_report, read_report_values
from taxel.gap.report.report_values import ReportValue
from taxel.hand.errors import format_path
from taxel.input_files import is_regular_file, open_regular_file
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import TaxelTable
from taxel.types import FloatArray, IndexArray

LEAST_LOAD_N: Final = 0.02
"""Force above which a taxel counts as loaded when the grasp with most loaded frames is chosen for the layer's law."""

MOST_GRASPS: Final = 8
"""Number of grasps of the simulation among which this grasp is chosen."""


@dataclass(frozen=True, eq=False)
class ExportSource:
    """Effects of a report with everything that their export needs.

    report: see `read_report`. sim: the simulated dataset, or None. missing: reason for which it is None, one line, or
    empty. model: its sensor model. table: its taxels.
    """

    report: ReportedGap
    sim: Path | None
    missing: str
    model: SensorModel | None
    table: TaxelTable | None

    @property
    def n(self) -> int:
        """Number of taxels."""
        return len(self.report.sensor)

    @cached_property
    def boards(self) -> tuple[int, ...]:
        """Addresses of the boards, ascending."""
        return tuple(np.unique(self.report.sensor).tolist())

    @cached_property
    def board(self) -> IndexArray:
        """Position of each taxel's board in `boards`, [n]."""
        return np.searchsorted(np.array(self.boards), self.report.sensor).astype(np.intp)

    def taxels_of_boards(self) -> Iterator[tuple[int, IndexArray]]:
        """Address and taxels [m] of every board."""
        for number, address in enumerate(self.boards):
            yield address, np.flatnonzero(self.board == number)

    @cached_property
    def layouts(self) -> tuple[BoardLayout, ...]:
        """Positions of the taxels of every board; none without a dataset."""
        return () if self.table is None else layouts_of(self.board, self.table)

    def blocks_of(self, effect: ReportedEffect) -> IndexArray:
        """Column of `effect.values` that acts on each taxel, [n]; -1 where the report has no value."""
        if effect.effect.scope == TAXEL:
            return np.arange(self.n)
        if effect.effect.scope == BOARD:
            column = {name: number for number, name in enumerate(effect.blocks)}
            return np.array([column.get(int(address), -1) for address in self.report.sensor], dtype=np.intp)
        return np.zeros(self.n, np.intp)

    def values_of(self, effect: ReportedEffect, name: str) -> FloatArray:
        """A parameter for each taxel, f64[n]; the neutral value where the report has none."""
        block = self.blocks_of(effect)
        row = effect.values[effect.parameters.index(name)]
        neutral = {one.name: one.neutral for one in effect.effect.parameters()}.get(name, 0.0)
        return np.where(block >= 0, row[np.maximum(block, 0)], neutral)

    @cached_property
    def law(self) -> Law | None:
        """Force over depth of a taxel's layer from the simulated grasp with most loaded frames; None without dataset.

        Raises GapInputError for a grasp without hold.
        """
        if self.sim is None or self.model is None:
            return None
        with GraspDataset(self.sim) as data:
            states = FrameStates(data)
            found = [states.of(data[name]) for name in data.ids[:MOST_GRASPS]]
            loads = [int((one.base.force > LEAST_LOAD_N).sum()) for one in found if one.base.force is not None]
            return law_of(found[int(np.argmax(loads))]) if loads else None


def read_source(report: str | PathLike[str], sim: str | PathLike[str] | None = None) -> ExportSource:
    """Read a report and the simulated dataset that it names, or the dataset `sim`.

    Without `sim`, a dataset that does not exist or has changed is left out, and `missing` states this. Raises
    GapInputError and DatasetError of one line for a wrong report, and for a dataset that is of another hand or not of a
    simulation.
    """
    found = read_report(report)
    if sim is None:
        inputs = ReportValue(read_report_values(report)).field("inputs")
        path = Path(inputs.field("sim").optional_text("path"))
        missing = _reason_against(path, found)
        if missing:
            return ExportSource(found, None, missing, None, None)
    else:
        path = Path(sim)
    with GraspDataset(path) as data:
        check_hand(found, data, format_path(path))
        return ExportSource(found, path, "", data.sensor_model, data.taxels)


def _reason_against(path: Path, found: ReportedGap) -> str:
    """The reason for which the dataset of a report cannot be used, or an empty text."""
    if not is_regular_file(path):
        return f"the simulated dataset {format_path(path)} was not found; give --sim"
    with open_regular_file(path) as file:
        if hashlib.file_digest(file, "sha256").hexdigest() != found.sim_sha256:
            return f"the simulated dataset {format_path(path)} has changed since the diagnosis; give --sim"
    return ""
