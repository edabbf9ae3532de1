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
from taxel.gap.apply.hand_check import check_hand
from taxel.gap.data.boards import BoardLayout, make_board_layouts
from taxel.gap.effects.effect import BOARD, TAXEL
from taxel.gap.effects.layer_law import ForceDepthLaw, estimate_taxel_law
from taxel.gap.report.reading import ReportedEffect, ReportedGap, read_report, read_report_values
from taxel.gap.report.report_values import ReportValue
from taxel.hand.errors import format_path
from taxel.input_files import is_regular_file, open_regular_file
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import TaxelTable
from taxel.types import FloatArray, IndexArray

MIN_LOAD_N: Final = 0.02
"""Force in newtons above which a taxel is treated as loaded when the grasp for the layer's force law is chosen."""

MAX_GRASPS: Final = 8
"""Number of simulated grasps, from the beginning of the dataset, among which the grasp with most loads is chosen.

Chosen: limits the time for reading."""


@dataclass(frozen=True, eq=False)
class ExportSource:
    """Effects of a report with all inputs of an export.

    report: content of the report, see `read_report`. sim: path of the simulated dataset; None if it is unusable.
    missing: why the dataset is unusable, one line; empty if there is a dataset. model: sensor model of the dataset;
    None if there is none. table: taxels of the dataset; None without a dataset.
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
        """Position of each taxel's board in `boards`, [n] (n taxels)."""
        return np.searchsorted(np.array(self.boards), self.report.sensor).astype(np.intp)

    def iterate_boards(self) -> Iterator[tuple[int, IndexArray]]:
        """Iterate over the boards: address, and indices of the m taxels, [m]."""
        for number, address in enumerate(self.boards):
            yield address, np.flatnonzero(self.board == number)

    @cached_property
    def layouts(self) -> tuple[BoardLayout, ...]:
        """Positions of the taxels of every board; empty without a dataset."""
        return () if self.table is None else make_board_layouts(self.board, self.table)

    def map_blocks(self, effect: ReportedEffect) -> IndexArray:
        """Return the column of `effect.values` for each taxel, [n] (n taxels); -1 for a taxel without a value in the
        report.
        """
        if effect.effect.scope == TAXEL:
            return np.arange(self.n)
        if effect.effect.scope == BOARD:
            column = {name: number for number, name in enumerate(effect.blocks)}
            return np.array([column.get(int(address), -1) for address in self.report.sensor], dtype=np.intp)
        return np.zeros(self.n, np.intp)

    def expand_values(self, effect: ReportedEffect, name: str) -> FloatArray:
        """Return the value of the parameter `name` for each taxel, f64[n] (n taxels); the neutral value where the
        report has none.
        """
        block = self.map_blocks(effect)
        row = effect.values[effect.parameters.index(name)]
        neutral = {one.name: one.neutral for one in effect.effect.parameters()}.get(name, 0.0)
        return np.where(block >= 0, row[np.maximum(block, 0)], neutral)

    @cached_property
    def law(self) -> ForceDepthLaw | None:
        """Force of a taxel's layer as a function of depth, from the simulated grasp with the most loaded taxels.

        None without a dataset, a sensor model or contact forces. Raises GapInputError for a grasp without hold.
        """
        if self.sim is None or self.model is None:
            return None
        with GraspDataset(self.sim) as data:
            states = FrameStates(data)
            grasps = [states.build_state(data[name]) for name in data.ids[:MAX_GRASPS]]
            loads = [int((one.base.force > MIN_LOAD_N).sum()) for one in grasps if one.base.force is not None]
            return estimate_taxel_law(grasps[int(np.argmax(loads))]) if loads else None


def read_source(report: str | PathLike[str], sim: str | PathLike[str] | None = None) -> ExportSource:
    """Read a report and the simulated dataset that it names, or the dataset `sim`.

    Without `sim`, a dataset that does not exist or has changed is omitted, and `ExportSource.missing` states this.
    Raises GapInputError and DatasetError with a one-line message for a wrong report, and for a dataset that is of
    another hand or not of a simulation.
    """
    reported = read_report(report)
    if sim is None:
        inputs = ReportValue(read_report_values(report)).field("inputs")
        path = Path(inputs.field("sim").optional_text("path"))
        missing = _explain_unusable_dataset(path, reported)
        if missing:
            return ExportSource(reported, None, missing, None, None)
    else:
        path = Path(sim)
    with GraspDataset(path) as data:
        check_hand(reported, data, format_path(path))
        return ExportSource(reported, path, "", data.sensor_model, data.taxels)


def _explain_unusable_dataset(path: Path, reported: ReportedGap) -> str:
    """Return why the simulated dataset that a report names cannot be used; an empty string if it can be used.

    A dataset is unusable if the file does not exist, or if its SHA-256 differs from that in the report.
    """
    if not is_regular_file(path):
        return f"the simulated dataset {format_path(path)} was not found; give --sim"
    with open_regular_file(path) as file:
        if hashlib.file_digest(file, "sha256").hexdigest() != reported.sim_sha256:
            return f"the simulated dataset {format_path(path)} has changed since the diagnosis; give --sim"
    return ""
