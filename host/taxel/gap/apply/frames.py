"""Simulated grasps, frame by frame, as what effects act on: states whose nodes of time are a grasp's frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.clock import Clock
from taxel.gap.data.pair import Pair, grouped
from taxel.gap.data.reading import Phases, Recording, require_hold
from taxel.gap.errors import GapInputError
from taxel.gap.features.features import Layout
from taxel.gap.fitting.state import Signal, State
from taxel.recording.grasp_format import BASELINE_FRAMES, Phase
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.types import FloatArray


class SimulatedGrasp(Phases, Protocol):
    """One grasp of a simulation, read from a file or in memory; fields as those of `taxel.recording.grasp.Grasp`."""

    @property
    def object(self) -> str:
        """Name of the object."""

    @property
    def approach(self) -> str:
        """Name of the approach."""

    @property
    def timestamp(self) -> FloatArray:
        """f64[T], seconds."""

    @property
    def raw_counts(self) -> NDArray[np.uint16]:
        """u16[T, n]."""

    @property
    def valid(self) -> NDArray[np.bool_]:
        """bool[T, s]: whether a sensor has answered."""

    @property
    def sensor_pose(self) -> FloatArray:
        """f64[s, 4, 4], world, brackets during hold."""

    @property
    def object_pose(self) -> FloatArray:
        """f64[4, 4], world, where it is believed to be."""

    @property
    def contact_force(self) -> FloatArray | None:
        """f64[T, n], newtons."""

    @property
    def separation(self) -> FloatArray | None:
        """f64[T, n], metres."""


class Simulation(Protocol):
    """What the grasps of a simulation have in common; fields as those of `GraspDataset`."""

    @property
    def path(self) -> Path:
        """The file, for messages."""

    @property
    def taxels(self) -> TaxelTable:
        """One row a taxel."""

    @property
    def sensors(self) -> SensorTable:
        """One row a sensor."""

    @property
    def objects(self) -> Mapping[str, ObjectMesh]:
        """Meshes by name."""

    @property
    def sensor_model(self) -> SensorModel | None:
        """How force becomes counts."""


@dataclass(frozen=True, eq=False)
class FrameClock(Clock):
    """Nodes that are frames. begin, end: f64[K], seconds since the first one; a frame stands until the next."""

    @classmethod
    def at(cls, time_s: FloatArray, phase: NDArray[np.uint8]) -> FrameClock:
        """time_s: f64[K], seconds. phase: u8[K]."""
        since = time_s - time_s[0]
        last = float(np.median(np.diff(since))) if len(since) > 1 else 0.0
        everything = ((Phase(int(phase[-1])), slice(0, len(phase))),)
        return cls(phase, since, np.append(since[1:], since[-1] + last), everything)

    @cached_property
    def since_start(self) -> FloatArray:
        """Middle of each frame's time, f64[K]: phases need not follow each other here."""
        return 0.5 * (self.begin + self.end)


def moving(grasp: Phases) -> NDArray[np.intp]:
    """The frames that effects act on, from closing on: a drop is counted from the baseline, which has none."""
    return np.flatnonzero(grasp.phase != Phase.BASELINE)


class FrameStates:
    """The states of a simulation's grasps. data: with source "sim"; a file must be open."""

    def __init__(self, data: Simulation) -> None:
        self._data, self._groups = data, grouped(data.taxels, data.sensors)

    def of(self, grasp: SimulatedGrasp) -> State:
        """The state of a grasp's `moving` frames; what only features need is empty.

        Raises GapInputError for a grasp without hold, and for one whose time stands still.
        """
        assert grasp.contact_force is not None  # a simulation has them
        assert grasp.separation is not None
        require_hold(grasp, str(self._data.path))
        own = moving(grasp)
        clock = FrameClock.at(grasp.timestamp[own], grasp.phase[own])
        if not clock.since_start[-1] > 0.0:
            where = f"{self._data.path}: /grasps/{grasp.id}/timestamp"
            raise GapInputError(where, "increasing time from closing on", "constant time", "correct the file")
        base = Signal(grasp.contact_force[None, own], grasp.separation[None, own], None)
        layout, pair = Layout.of(clock), self._pair(grasp, clock)
        return State(pair, layout, clock, np.zeros(1, np.intp), base, np.zeros((1, layout.count, pair.n)))

    def _pair(self, grasp: SimulatedGrasp, clock: Clock) -> Pair:
        data = self._data
        empty: dict[str, Any] = dict.fromkeys(Recording.__dataclass_fields__, np.zeros(0))
        still = min(int((grasp.phase == Phase.BASELINE).sum()), BASELINE_FRAMES)
        nothing = Recording(**{**empty, "frames": np.array([still])})
        return Pair(
            conditions=((grasp.object, grasp.approach),),
            taxels=data.taxels,
            sensors=data.sensors,
            groups=self._groups,
            clock=clock,
            frame_s=float(np.median(clock.end - clock.begin)),
            real=nothing,
            sim=nothing,
            sensor_model=data.sensor_model,
            objects=dict(data.objects),
            sensor_poses=grasp.sensor_pose[None],
            object_poses=grasp.object_pose[None],
            paths=(str(data.path), str(data.path)),
            digests=("", ""),
            losses=(),
        )
