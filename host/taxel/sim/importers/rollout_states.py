"""Reading of the states of a rollout from an .npz file."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.input_files.numpy_archive import ArchiveError, NumpyArchive
from taxel.recording.grasp_format import LARGEST_ARRAY_BYTES
from taxel.sim.importers.errors import FileLocation, suggest_names
from taxel.sim.importers.hand_motion import parse_phase
from taxel.types import FloatArray

__all__ = ["STATES", "RolloutStates", "read_states"]

STATES = ("qpos", "qvel", "act", "ctrl", "mocap_pos", "mocap_quat", "qfrc_applied", "eq_active")
LABELS = ("grasp", "approach", "iteration", "session", "phase", "time")

_DEFAULTS: dict[str, Any] = {"grasp": "0001", "approach": "rollout", "iteration": 0, "session": 0, "phase": "hold"}


@dataclass(frozen=True, eq=False)
class RolloutStates:
    """The T recorded states of a MuJoCo rollout.

    values: arrays f64[T, ...] by name, of the names `STATES` that the file contains. time_s: f64[T]. phase: u8[T].
    grasp, approach: names of each state [T]. iteration, session: i64[T]. has_start_only: whether qpos, qvel and act
    contain the first state only.
    """

    source: FileLocation
    values: dict[str, FloatArray]
    time_s: FloatArray
    phase: NDArray[np.uint8]
    grasp: list[str]
    approach: list[str]
    iteration: NDArray[np.int64]
    session: NDArray[np.int64]
    has_start_only: bool

    def rows_by_grasp(self) -> list[NDArray[np.intp]]:
        """Return the rows of each grasp, i64, in the order of the file.

        Raises ImportDataError for a grasp whose rows are not consecutive, whose times do not increase or whose labels
        change.
        """
        boundaries = [row for row in range(1, len(self.grasp)) if self.grasp[row] != self.grasp[row - 1]]
        groups = np.split(np.arange(len(self.grasp)), boundaries)
        names: set[str] = set()
        for rows in groups:
            name = self.grasp[int(rows[0])]
            if name in names:
                location = self.source.key(f"grasp[{rows[0]}]")
                found = f"further states of {format_value(name)}"
                location.fail("consecutive states of each grasp", found, "sort the states by grasp")
            names.add(name)
            decreasing = np.flatnonzero(np.diff(self.time_s[rows]) <= 0)
            if len(decreasing):
                row = int(rows[decreasing[0] + 1])
                found = f"{self.time_s[row]:.9g} after {self.time_s[row - 1]:.9g}"
                location = self.source.key(f"time[{row}]")
                location.fail("increasing times within a grasp", found, "sort the states, or label the grasps")
            for key, values in (("approach", self.approach), ("iteration", self.iteration), ("session", self.session)):
                for row in rows:
                    if values[row] != values[rows[0]]:
                        location = self.source.key(f"{key}[{row}]")
                        found, remedy = format_value(str(values[row])), "correct it, or name a new grasp"
                        location.fail(f"the same {key} in all states of a grasp", found, remedy)
        return groups


def read_states(path: str | os.PathLike[str], sizes: dict[str, tuple[int, ...]], step_s: float) -> RolloutStates:
    """Read an .npz file of states. Raises ImportDataError for the first error in the file.

    All arrays have one row for each state. As an exception, qpos, qvel and act may contain only the row of the first
    state. sizes: shape of one row of each array of `STATES`. step_s: time step of a file without times, seconds.
    """
    source = FileLocation(os.fspath(path))
    arrays = _load_arrays(Path(path), source)
    for name in arrays:
        if name not in STATES + LABELS:
            remedy = f"rename or remove the array ({suggest_names(name, STATES + LABELS)})"
            source.key(name).fail("an array of a known name", "an unknown name", remedy)
    if "qpos" not in arrays:
        source.key("qpos").fail(f"an array [T, {sizes['qpos'][0]}]", "none", "save the states with numpy.savez")
    values = {name: _check_state(arrays[name], sizes[name], source.key(name)) for name in STATES if name in arrays}
    frames = len(values.get("ctrl", values["qpos"]))
    has_start_only = len(values["qpos"]) == 1 and frames > 1
    for name, value in values.items():
        if len(value) != frames and not (has_start_only and name in ("qpos", "qvel", "act")):
            source.key(name).fail(
                f"{frames} rows, as in the other arrays", str(len(value)), "give one row for each state"
            )
    labels = {
        name: _broadcast_labels(arrays.get(name, default), frames, source.key(name))
        for name, default in _DEFAULTS.items()
    }
    phase = [parse_phase(value, source.key(f"phase[{row}]")) for row, value in enumerate(labels["phase"])]
    time = (
        _check_state(arrays["time"], (), source.key("time"))
        if "time" in arrays
        else np.asarray(step_s * np.arange(frames), np.float64)
    )
    if len(time) != frames:
        source.key("time").fail(f"{frames} times", str(len(time)), "give one time for each state")
    iteration, session = (_parse_integers(labels[name], source.key(name)) for name in ("iteration", "session"))
    grasp, approach = labels["grasp"], labels["approach"]
    states = RolloutStates(
        source, values, time, np.array(phase, np.uint8), grasp, approach, iteration, session, has_start_only
    )
    if has_start_only and len(states.rows_by_grasp()) > 1:
        source.key("qpos").fail("a state in each row", "one row for several grasps", "give qpos [T, nq]")
    return states


def _load_arrays(path: Path, source: FileLocation) -> dict[str, NDArray[Any]]:
    """Load the arrays of an .npz file by name. Raises ImportDataError for a file that is missing or not an archive."""
    if not path.is_file():
        source.fail("an .npz file", "a folder" if path.is_dir() else "no such file", "check the path")
    try:
        with NumpyArchive(path) as archive:
            return {name: archive.read(name, LARGEST_ARRAY_BYTES) for name in archive.names}
    except (ArchiveError, OSError) as error:
        source.fail("an .npz file of plain arrays", format_value(str(error)), "save numbers and texts with numpy.savez")


def _check_state(array: NDArray[Any], row_shape: tuple[int, ...], location: FileLocation) -> FloatArray:
    """Return the array as f64[T, *row_shape]. Raises ImportDataError for another shape, type or an infinite number."""
    shape = ", ".join(["T", *map(str, row_shape)])
    has_shape = array.ndim == len(row_shape) + 1 and array.shape[1:] == row_shape and len(array) > 0
    if array.dtype.kind not in "fiub" or not has_shape:
        found = f"{array.dtype} {list(array.shape)}"
        location.fail(f"numbers [{shape}], as in the model", found, "save the states of this model")
    values = array.astype(np.float64)
    if not np.isfinite(values).all():
        index = [int(i) for i in np.argwhere(~np.isfinite(values))[0]]
        remedy = "remove the states after the simulation diverged"
        location.fail("finite numbers", f"{values[tuple(index)]} at {index}", remedy)
    return values


def _broadcast_labels(value: Any, frames: int, location: FileLocation) -> list[str]:
    """Return one label for each state, as strings. Raises ImportDataError for another shape or type.

    value: one label, or an array of labels. frames: number of states.
    """
    array = np.asarray(value)
    if array.ndim == 0:
        array = np.broadcast_to(array, (frames,))
    if array.shape != (frames,) or array.dtype.kind not in "Uiu":
        found = f"{array.dtype} {list(array.shape)}"
        location.fail(f"a name or a number, or {frames} of them", found, "give texts or integers")
    return [str(item) for item in array.tolist()]


def _parse_integers(values: list[str], location: FileLocation) -> NDArray[np.int64]:
    """Convert labels to integers, i64[T]. Raises ImportDataError for a label that is not an integer of 0 or more."""
    for row, value in enumerate(values):
        if not (value.isascii() and value.isdigit()):
            field = FileLocation(location.file, f"{location.field}[{row}]")
            field.fail("an integer of 0 or more", format_value(value), "count from 0")
    return np.array(values, np.int64)
