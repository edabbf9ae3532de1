"""States of simulated grasps whose time nodes are the frames, so that effects can change every frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.pair import Pair, group_taxels
from taxel.gap.data.reading import GraspPhases, Recording, require_hold
from taxel.gap.data.time_grid import TimeGrid
from taxel.gap.errors import GapInputError
from taxel.gap.features.features import FeatureLayout
from taxel.gap.fitting.state import Signal, State
from taxel.recording.grasp_format import BASELINE_FRAMES, Phase
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.types import FloatArray


class SimulatedGrasp(GraspPhases, Protocol):
    """One simulated grasp of T frames, n taxels and s sensors, from a file or in memory.

    The properties have the meaning of those of `taxel.recording.grasp.Grasp`.
    """

    @property
    def object(self) -> str:
        """Name of the object."""

    @property
    def approach(self) -> str:
        """Name of the approach."""

    @property
    def timestamp(self) -> FloatArray:
        """Times of the frames, f64[T] (T frames), seconds."""

    @property
    def raw_counts(self) -> NDArray[np.uint16]:
        """Raw counts, u16[T, n] (T frames, n taxels)."""

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Whether the frame of a sensor arrived, bool[T, s] (T frames, s boards)."""

    @property
    def sensor_pose(self) -> FloatArray:
        """Poses of the sensor brackets during hold in world coordinates, f64[s, 4, 4] (s boards), metres."""

    @property
    def object_pose(self) -> FloatArray:
        """Nominal pose of the object in world coordinates, f64[4, 4], metres."""

    @property
    def contact_force(self) -> FloatArray | None:
        """Contact forces, f64[T, n] (T frames, n taxels), newtons."""

    @property
    def separation(self) -> FloatArray | None:
        """Distances between taxel and object, f64[T, n] (T frames, n taxels), metres; negative for a penetration."""


class Simulation(Protocol):
    """Data that all grasps of a simulation share; the properties have the meaning of those of `GraspDataset`."""

    @property
    def path(self) -> Path:
        """Path of the file, for error messages."""

    @property
    def taxels(self) -> TaxelTable:
        """Table with one row for each taxel."""

    @property
    def sensors(self) -> SensorTable:
        """Table with one row for each sensor."""

    @property
    def objects(self) -> Mapping[str, ObjectMesh]:
        """Meshes of the objects by name."""

    @property
    def sensor_model(self) -> SensorModel | None:
        """Relation between force and counts; None if the simulation states none."""


@dataclass(frozen=True, eq=False)
class FrameTimeGrid(TimeGrid):
    """Time grid whose K nodes are the frames of one grasp.

    begin, end: f64[K], seconds since the first frame; a node ends at the next frame.
    """

    @classmethod
    def from_frames(cls, time_s: FloatArray, phase: NDArray[np.uint8]) -> FrameTimeGrid:
        """Return the time grid of K frames. time_s: times of the frames, f64[K], seconds. phase: u8[K].

        Each node is one frame and lasts until the next frame; the last node has the median duration. All frames form
        a single bin, because a time grid must have a bin. Effects that act on frames use neither the bin nor its phase.
        """
        since = time_s - time_s[0]
        last_duration = float(np.median(np.diff(since))) if len(since) > 1 else 0.0
        single_bin = ((Phase(int(phase[-1])), slice(0, len(phase))),)
        return cls(phase, since, np.append(since[1:], since[-1] + last_duration), single_bin)

    @cached_property
    def time_since_start_s(self) -> FloatArray:
        """Middle of each node in seconds since the first frame, f64[K] (K frames).

        Unlike in the base class, the times already count from the first frame, not from the beginning of a phase.
        """
        return 0.5 * (self.begin + self.end)


def find_effect_frames(grasp: GraspPhases) -> NDArray[np.intp]:
    """Return the indices of the frames that effects on the signal change: all frames outside the baseline phase.

    The signal is the difference from the baseline, so effects on the signal do not change baseline frames.
    """
    return np.flatnonzero(grasp.phase != Phase.BASELINE)


class FrameStates:
    """Builder of states for the grasps of a simulation. A state has the frames of one grasp as time nodes."""

    def __init__(self, data: Simulation) -> None:
        """Prepare the builder. data: a simulated dataset; a file must be open."""
        self._data, self._groups = data, group_taxels(data.taxels, data.sensors)

    def build_state(self, grasp: SimulatedGrasp) -> State:
        """Return the state of the frames of a grasp outside the baseline phase.

        Fields of the state that only the features need are empty. Raises GapInputError for a grasp without hold, and
        for a grasp with a constant time.
        """
        assert grasp.contact_force is not None  # a simulated dataset always contains forces
        assert grasp.separation is not None
        require_hold(grasp, str(self._data.path))
        frames = find_effect_frames(grasp)
        time_grid = FrameTimeGrid.from_frames(grasp.timestamp[frames], grasp.phase[frames])
        if not time_grid.time_since_start_s[-1] > 0.0:
            where = f"{self._data.path}: /grasps/{grasp.id}/timestamp"
            raise GapInputError(where, "increasing time from closing on", "constant time", "correct the file")
        base = Signal(grasp.contact_force[None, frames], grasp.separation[None, frames], None)
        layout, pair = FeatureLayout.from_time_grid(time_grid), self._build_pair(grasp, time_grid)
        # One contact in condition 0; its mean features, which effects on frames do not use, are 0.
        return State(pair, layout, time_grid, np.zeros(1, np.intp), base, np.zeros((1, layout.count, pair.n)))

    def _build_pair(self, grasp: SimulatedGrasp, time_grid: TimeGrid) -> Pair:
        """Return a pair with the condition of one grasp, which contains only the data that effects use."""
        data = self._data
        empty_fields: dict[str, Any] = dict.fromkeys(Recording.__dataclass_fields__, np.zeros(0))
        baseline_frames = min(int((grasp.phase == Phase.BASELINE).sum()), BASELINE_FRAMES)
        no_recording = Recording(**{**empty_fields, "baseline_frames": np.array([baseline_frames])})
        return Pair(
            conditions=((grasp.object, grasp.approach),),
            taxels=data.taxels,
            sensors=data.sensors,
            groups=self._groups,
            time_grid=time_grid,
            frame_s=float(np.median(time_grid.end - time_grid.begin)),
            real=no_recording,
            sim=no_recording,
            sensor_model=data.sensor_model,
            objects=dict(data.objects),
            sensor_poses=grasp.sensor_pose[None],
            object_poses=grasp.object_pose[None],
            paths=(str(data.path), str(data.path)),
            digests=("", ""),
            losses=(),
        )
