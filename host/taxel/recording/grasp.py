"""One grasp of a dataset, read from the file when touched."""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.recording.grasp_checks import check_content, check_integer, check_text
from taxel.recording.grasp_format import (
    ACTIVE_SIGNAL_COUNTS,
    BASELINE_FRAMES,
    GRASP,
    SIM,
    Phase,
    needs,
)
from taxel.recording.grasp_hdf5 import Node, read_only, scalar
from taxel.types import BoolArray, FloatArray


class Grasp:
    """One grasp: T frames of n taxels on s sensors. The arrays are read-only and as the format page says.

    An array is read and checked when it is first touched (DatasetError) and kept as long as this object lives.
    """

    def __init__(self, node: Node, grasp_id: str, source: str, s: int, sensor_index: NDArray[np.int64]) -> None:
        """sensor_index: [n], each taxel's sensor, 0 to s - 1."""
        self.id = grasp_id
        self._node = node
        self._source = source
        self._sizes = {"n": len(sensor_index), "s": s}
        self._sensor_index = sensor_index
        self._arrays: dict[str, NDArray[Any] | None] = {}
        place = node.place
        text = {name: scalar(node.attribute(name), place.key(name)) for name in ("object", "approach")}
        number = {name: scalar(node.attribute(name), place.key(name)) for name in ("iteration", "session")}
        self.object: str = check_text(text["object"], place.key("object"))
        self.approach: str = check_text(text["approach"], place.key("approach"))
        self.iteration: int = check_integer(number["iteration"], place.key("iteration"))
        self.session: int = check_integer(number["session"], place.key("session"))
        for name, spec in GRASP.items():
            there = node.has(name)
            if there and spec.sim_only and source != SIM:
                place.key(name).fail('no such array where source = "real"', "one", "remove it or correct the source")
            if there or needs(spec, source):
                node.check_array(name, spec, self._sizes)

    def fresh(self) -> Grasp:
        """The same grasp with no array read yet. Its head, which was checked when this one was made, is taken over."""
        other = copy(self)
        other._arrays = {}
        return other

    @property
    def n_frames(self) -> int:
        """T."""
        return self._sizes["T"]

    @property
    def timestamp(self) -> FloatArray:
        """f64[T], seconds, never going back."""
        return self._needed("timestamp")

    @property
    def phase(self) -> NDArray[np.uint8]:
        """u8[T], the commanded state, see `Phase`."""
        return self._needed("phase")

    @property
    def raw_counts(self) -> NDArray[np.uint16]:
        """u16[T, n]; contact lowers the count."""
        return self._needed("raw_counts")

    @property
    def valid(self) -> BoolArray:
        """bool[T, s]; False: that sensor's frame did not arrive."""
        return self._needed("valid")

    @property
    def sensor_pose(self) -> FloatArray:
        """f64[s, 4, 4], bracket frame in world during hold, as kinematics give it, metres."""
        return self._needed("sensor_pose")

    @property
    def object_pose(self) -> FloatArray:
        """f64[4, 4], nominal object frame in world, metres."""
        return self._needed("object_pose")

    @property
    def sensor_time(self) -> FloatArray | None:
        """f64[T, s], seconds, each board's own clock."""
        return self._array("sensor_time")

    @property
    def sensor_pose_t(self) -> FloatArray | None:
        """f64[T, s, 4, 4], bracket frames over time, metres."""
        return self._array("sensor_pose_t")

    @property
    def joint_position(self) -> FloatArray | None:
        """f64[T, j], radians."""
        return self._array("joint_position")

    @property
    def contact_force(self) -> FloatArray | None:
        """f64[T, n], newtons, normal to the taxel, before any sensor effect; only in simulation."""
        return self._array("contact_force")

    @property
    def separation(self) -> FloatArray | None:
        """f64[T, n], metres along the normal, negative = pressed in, 0.05 where it misses; only in simulation."""
        return self._array("separation")

    @property
    def distance(self) -> FloatArray | None:
        """f64[T, n], Euclidean distance to the object, metres; only in simulation."""
        return self._array("distance")

    def check(self) -> None:
        """Read every array once, without keeping it; raises DatasetError for the first mistake."""
        for name in GRASP:
            self._read(name)

    def baseline(self, n: int = BASELINE_FRAMES) -> FloatArray:
        """f64[n_taxels], counts: mean of the first n valid phase-0 frames of each taxel's sensor.

        NaN for the taxels of a sensor that is missing: not one valid frame in the whole grasp.
        Raises DatasetError where a sensor has fewer, but is not missing.
        """
        present: BoolArray = np.any(self.valid, axis=0)
        self._require(_positive(n), present)
        total, count = self._sums(self._frames(Phase.BASELINE, n), present)
        return np.where(present[self._sensor_index], total / count, np.nan)

    def mean_hold_signal(self, baseline_frames: int = BASELINE_FRAMES) -> FloatArray:
        """f64[n], counts: baseline minus mean over the valid hold frames; NaN where a sensor has no valid hold frame.

        Raises DatasetError where a sensor has valid hold frames and too few for its baseline.
        """
        hold = self._frames(Phase.HOLD)
        known: BoolArray = np.any(hold, axis=0)
        self._require(_positive(baseline_frames), known)
        rest_sum, rest_count = self._sums(self._frames(Phase.BASELINE, baseline_frames), known)
        hold_sum, hold_count = self._sums(hold, known)
        # Exact integers until the one division: a signal of exactly the threshold must not round to above it.
        signal = (rest_sum * hold_count - hold_sum * rest_count) / (rest_count * hold_count)
        return np.where(known[self._sensor_index], signal, np.nan)

    def active(
        self, threshold: float = ACTIVE_SIGNAL_COUNTS, baseline_frames: int = BASELINE_FRAMES
    ) -> tuple[BoolArray, BoolArray]:
        """Which taxels were active during hold, and of which that is known: (bool[n], bool[n]).

        Active: the signal exceeds threshold, strictly. Not known: the sensor has no valid hold frame; that is missing,
        not inactive. Raises DatasetError as `mean_hold_signal` does.
        """
        signal = self.mean_hold_signal(baseline_frames)
        known = ~np.isnan(signal)
        return known & (np.where(known, signal, 0.0) > threshold), known

    def require_baseline(self, frames: int) -> None:
        """Refuse a grasp with fewer valid phase-0 frames than asked for on a sensor that is not missing."""
        present: BoolArray = np.any(self.valid, axis=0)
        self._require(frames, present)

    def _require(self, frames: int, wanted: BoolArray) -> None:
        expected = f"{frames} baseline frames (phase 0)"
        remedy = "ask for fewer, or leave this grasp out"
        commanded = int((self.phase == Phase.BASELINE).sum())
        if commanded < frames:
            self._node.place.key("phase").fail(expected, str(commanded), remedy)
        valid = self._frames(Phase.BASELINE).sum(axis=0)
        short = np.flatnonzero(wanted & (valid < frames))
        if short.size:
            found = f"{valid[short[0]]} valid ones of the sensor in column {short[0]}"
            self._node.place.key("valid").fail(expected, found, remedy)

    def _frames(self, phase: Phase, first: int | None = None) -> BoolArray:
        """bool[T, s]: the valid frames of a phase, of each sensor only the first few."""
        frames: BoolArray = self.valid & (self.phase == phase)[:, None]
        return frames if first is None else frames & (np.cumsum(frames, axis=0) <= first)

    def _sums(self, frames: BoolArray, sensors: BoolArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """i64[n], i64[n]: sum of the raw counts over a sensor's frames, and their number; (0, 1) for other sensors."""
        total = np.zeros(self._sizes["n"], np.int64)
        count = np.ones(self._sizes["n"], np.int64)
        for sensor in np.flatnonzero(sensors):
            taxels = np.flatnonzero(self._sensor_index == sensor)
            chosen = np.flatnonzero(frames[:, sensor])
            total[taxels] = self.raw_counts[np.ix_(chosen, taxels)].sum(axis=0, dtype=np.int64)
            count[taxels] = chosen.size
        return total, count

    def _needed(self, name: str) -> NDArray[Any]:
        array = self._array(name)
        assert array is not None  # its presence was checked when the grasp was opened
        return array

    def _array(self, name: str) -> NDArray[Any] | None:
        if name not in self._arrays:
            self._arrays[name] = self._read(name)
        return self._arrays[name]

    def _read(self, name: str) -> NDArray[Any] | None:
        spec = GRASP[name]
        if not needs(spec, self._source) and not self._node.has(name):
            return None
        array = self._node.array(name, spec, self._sizes)
        check_content(name, array, self._node.place.key(name))
        return read_only(array)


def _positive(frames: int) -> int:
    if frames < 1:
        raise ValueError(f"baseline frames: expected 1 or more, found {frames}")
    return frames
