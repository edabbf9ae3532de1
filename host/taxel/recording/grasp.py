"""One grasp of a dataset. Its arrays are read from the file on first use."""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.recording.grasp_checks import check_content, check_integer, check_outcome, check_text
from taxel.recording.grasp_format import (
    ACTIVE_SIGNAL_COUNTS,
    BASELINE_FRAMES,
    GRASP,
    NO_FAILURE,
    OPTIONAL_GRASP_ATTRIBUTES,
    SIM,
    Phase,
    is_required,
)
from taxel.recording.grasp_hdf5 import Node, scalar, set_read_only
from taxel.types import BoolArray, ByteArray, CountArray, FloatArray, IntArray


class Grasp:
    """One grasp: T frames of n taxels on s sensors. Arrays are read-only; the format page defines their content.

    attempts: number of attempts of the grasp, from 1. failure: kind of the failure of the recorded attempt, "none" for
    a successful one. Both are None if the file does not state them.

    An array is read and checked on first use (DatasetError) and stays in memory as long as this object exists.
    """

    def __init__(self, node: Node, grasp_id: str, source: str, s: int, sensor_index: IntArray) -> None:
        """Create a grasp whose arrays are read from an HDF5 group on first use.

        node: the group. source: "real" or "sim". s: number of sensors. sensor_index: i64[n], row of each taxel's sensor
        in the sensor table, 0 to s - 1.
        """
        self.id = grasp_id
        self._node = node
        self._source = source
        self._sizes = {"n": len(sensor_index), "s": s}
        self._sensor_index = sensor_index
        self._arrays: dict[str, NDArray[Any] | None] = {}
        location = node.location
        text = {name: scalar(node.attribute(name), location.key(name)) for name in ("object", "approach")}
        number = {name: scalar(node.attribute(name), location.key(name)) for name in ("iteration", "session")}
        self.object: str = check_text(text["object"], location.key("object"))
        self.approach: str = check_text(text["approach"], location.key("approach"))
        self.iteration: int = check_integer(number["iteration"], location.key("iteration"))
        self.session: int = check_integer(number["session"], location.key("session"))
        self.attempts, self.failure = _read_outcome(node)
        for name, spec in GRASP.items():
            is_present = node.has(name)
            if is_present and spec.sim_only and source != SIM:
                location.key(name).fail('no such array where source = "real"', "one", "remove it or correct the source")
            if is_present or is_required(spec, source):
                node.check_array(name, spec, self._sizes)

    def copy_without_arrays(self) -> Grasp:
        """Return a copy of the grasp that has read no array yet. The attributes are not checked again."""
        other = copy(self)
        other._arrays = {}
        return other

    @property
    def has_failed(self) -> bool | None:
        """Whether the recorded attempt of the grasp failed; None: not known."""
        return None if self.failure is None else self.failure != NO_FAILURE

    @property
    def n_frames(self) -> int:
        """Number T of frames in the grasp."""
        return self._sizes["T"]

    @property
    def timestamp(self) -> FloatArray:
        """f64[T], seconds, not decreasing."""
        return self._get_required_array("timestamp")

    @property
    def phase(self) -> ByteArray:
        """u8[T], the commanded phase, see `Phase`."""
        return self._get_required_array("phase")

    @property
    def raw_counts(self) -> CountArray:
        """u16[T, n]; contact lowers the count."""
        return self._get_required_array("raw_counts")

    @property
    def valid(self) -> BoolArray:
        """bool[T, s]; False where the frame of the sensor did not arrive."""
        return self._get_required_array("valid")

    @property
    def sensor_pose(self) -> FloatArray:
        """f64[s, 4, 4], bracket frames in the world during hold, from the kinematics, metres."""
        return self._get_required_array("sensor_pose")

    @property
    def object_pose(self) -> FloatArray:
        """f64[4, 4], nominal object frame in the world, metres."""
        return self._get_required_array("object_pose")

    @property
    def sensor_time(self) -> FloatArray | None:
        """f64[T, s], seconds on the clock of each board."""
        return self._get_array("sensor_time")

    @property
    def sensor_pose_t(self) -> FloatArray | None:
        """f64[T, s, 4, 4], bracket frames over time, metres."""
        return self._get_array("sensor_pose_t")

    @property
    def joint_position(self) -> FloatArray | None:
        """f64[T, j], radians."""
        return self._get_array("joint_position")

    @property
    def contact_force(self) -> FloatArray | None:
        """f64[T, n], newtons, normal to the taxel, before any sensor effect; only in simulation."""
        return self._get_array("contact_force")

    @property
    def separation(self) -> FloatArray | None:
        """f64[T, n], distance to the object along the normal, metres, negative inside the object; only in simulation.

        0.05 m if the normal does not hit the object.
        """
        return self._get_array("separation")

    @property
    def distance(self) -> FloatArray | None:
        """f64[T, n], Euclidean distance to the object, metres; only in simulation."""
        return self._get_array("distance")

    def check(self) -> None:
        """Read and check every array of the grasp without keeping it; raises DatasetError for the first error."""
        for name in GRASP:
            self._read(name)

    def baseline(self, n: int = BASELINE_FRAMES) -> FloatArray:
        """Baseline counts of each taxel, f64[n]: mean of the first n valid frames of its sensor in phase 0 (baseline).

        NaN for the taxels of a missing sensor, which has no valid frame in the whole grasp. Raises DatasetError if
        another sensor has fewer than n frames.
        """
        is_present: BoolArray = np.any(self.valid, axis=0)
        self._check_baseline_frames(_check_positive(n), is_present)
        total, count = self._sum_counts(self._find_frames_of_phase(Phase.BASELINE, n), is_present)
        return np.where(is_present[self._sensor_index], total / count, np.nan)

    def mean_hold_signal(self, baseline_frames: int = BASELINE_FRAMES) -> FloatArray:
        """Mean signal of each taxel in the hold phase, counts, f64[n]: baseline minus mean of the valid hold frames.

        NaN if a sensor has no valid hold frame. Raises DatasetError if a sensor has valid hold frames but too few
        baseline frames.
        """
        hold = self._find_frames_of_phase(Phase.HOLD)
        has_hold: BoolArray = np.any(hold, axis=0)
        self._check_baseline_frames(_check_positive(baseline_frames), has_hold)
        baseline = self._find_frames_of_phase(Phase.BASELINE, baseline_frames)
        baseline_sum, baseline_count = self._sum_counts(baseline, has_hold)
        hold_sum, hold_count = self._sum_counts(hold, has_hold)
        # Exact integers up to the one division: a signal equal to the threshold must not be rounded above it.
        signal = (baseline_sum * hold_count - hold_sum * baseline_count) / (baseline_count * hold_count)
        return np.where(has_hold[self._sensor_index], signal, np.nan)

    def active_taxels(
        self, threshold: float = ACTIVE_SIGNAL_COUNTS, baseline_frames: int = BASELINE_FRAMES
    ) -> tuple[BoolArray, BoolArray]:
        """Return which taxels were active during hold, and for which taxels this is known: (bool[n], bool[n]).

        A taxel is active if its mean hold signal exceeds the threshold (strictly). The state is unknown if the sensor
        has no valid hold frame: such a taxel is missing, not inactive. Raises DatasetError as `mean_hold_signal` does.
        """
        signal = self.mean_hold_signal(baseline_frames)
        is_known = ~np.isnan(signal)
        return is_known & (np.where(is_known, signal, 0.0) > threshold), is_known

    def require_baseline(self, frames: int) -> None:
        """Raise DatasetError if a sensor that is not missing has fewer than `frames` valid phase-0 frames."""
        is_present: BoolArray = np.any(self.valid, axis=0)
        self._check_baseline_frames(frames, is_present)

    def _check_baseline_frames(self, frames: int, sensors: BoolArray) -> None:
        """Raise DatasetError if one of the sensors bool[s] has fewer than `frames` valid baseline frames."""
        expected = f"{frames} baseline frames (phase 0)"
        remedy = "request fewer baseline frames, or leave this grasp out"
        commanded = int((self.phase == Phase.BASELINE).sum())
        if commanded < frames:
            self._node.location.key("phase").fail(expected, str(commanded), remedy)
        valid = self._find_frames_of_phase(Phase.BASELINE).sum(axis=0)
        short = np.flatnonzero(sensors & (valid < frames))
        if short.size:
            found = f"{valid[short[0]]} valid ones of the sensor in column {short[0]}"
            self._node.location.key("valid").fail(expected, found, remedy)

    def _find_frames_of_phase(self, phase: Phase, first: int | None = None) -> BoolArray:
        """Return which frames of each sensor are valid and in the phase, bool[T, s].

        first: largest number of frames for each sensor, from the start of the grasp; None: all.
        """
        frames: BoolArray = self.valid & (self.phase == phase)[:, None]
        return frames if first is None else frames & (np.cumsum(frames, axis=0) <= first)

    def _sum_counts(self, frames: BoolArray, sensors: BoolArray) -> tuple[IntArray, IntArray]:
        """Sum the raw counts of each taxel over frames of its sensor; return (sum i64[n], number of frames i64[n]).

        frames: bool[T, s], the frames to sum. sensors: bool[s], the sensors to sum. The result for taxels of other
        sensors is (0, 1), so that the caller can divide the sum by the number.
        """
        total = np.zeros(self._sizes["n"], np.int64)
        count = np.ones(self._sizes["n"], np.int64)
        for sensor in np.flatnonzero(sensors):
            taxels = np.flatnonzero(self._sensor_index == sensor)
            rows = np.flatnonzero(frames[:, sensor])
            total[taxels] = self.raw_counts[np.ix_(rows, taxels)].sum(axis=0, dtype=np.int64)
            count[taxels] = rows.size
        return total, count

    def _get_required_array(self, name: str) -> NDArray[Any]:
        """Return an array that every grasp of the format has."""
        array = self._get_array(name)
        assert array is not None  # __init__ has checked its presence
        return array

    def _get_array(self, name: str) -> NDArray[Any] | None:
        """Return an array of the grasp, or None if the grasp lacks this optional array; read it on first use only."""
        if name not in self._arrays:
            self._arrays[name] = self._read(name)
        return self._arrays[name]

    def _read(self, name: str) -> NDArray[Any] | None:
        """Read and check the array `name` of the grasp, read-only; None if an optional array is absent."""
        spec = GRASP[name]
        if not is_required(spec, self._source) and not self._node.has(name):
            return None
        array = self._node.array(name, spec, self._sizes)
        check_content(name, array, self._node.location.key(name))
        return set_read_only(array)


def _read_outcome(node: Node) -> tuple[int | None, str | None]:
    """Read the optional attributes of a grasp's outcome: attempts and failure, None where absent.

    node: group of the grasp. Raises DatasetError for an invalid value.
    """
    values = node.attributes(OPTIONAL_GRASP_ATTRIBUTES)
    outcome = {name: scalar(value, node.location.key(name)) for name, value in values.items()}
    return check_outcome(outcome.get("attempts"), outcome.get("failure"), node.location)


def _check_positive(frames: int) -> int:
    """Return `frames`, a number of baseline frames, unchanged. Raises ValueError for a number below 1."""
    if frames < 1:
        raise ValueError(f"baseline frames: expected 1 or more, found {frames}")
    return frames
