"""The states of a rollout, from an .npz file."""

import os
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.sim.importers.errors import Source, near_names
from taxel.sim.importers.hand_motion import phase_number
from taxel.types import FloatArray

__all__ = ["STATES", "RolloutStates", "read_states"]

STATES = ("qpos", "qvel", "act", "ctrl", "mocap_pos", "mocap_quat", "qfrc_applied")
LABELS = ("grasp", "approach", "iteration", "session", "phase", "time")

_DEFAULTS: dict[str, Any] = {"grasp": "0001", "approach": "rollout", "iteration": 0, "session": 0, "phase": "hold"}


@dataclass(frozen=True, eq=False)
class RolloutStates:
    """T states. values: of `STATES`, f64[T, ...], those that the file has (qpos has one row if `start_only`).

    time_s: f64[T]. phase: u8[T]. grasp, approach: [T] texts; iteration, session: i64[T].
    """

    source: Source
    values: dict[str, FloatArray]
    time_s: FloatArray
    phase: NDArray[np.uint8]
    grasp: list[str]
    approach: list[str]
    iteration: NDArray[np.int64]
    session: NDArray[np.int64]
    start_only: bool

    def grasps(self) -> list[NDArray[np.intp]]:
        """The rows of each grasp, in order; ImportDataError for one whose rows are apart or whose time goes back."""
        cuts = [row for row in range(1, len(self.grasp)) if self.grasp[row] != self.grasp[row - 1]]
        parts = np.split(np.arange(len(self.grasp)), cuts)
        seen: set[str] = set()
        for rows in parts:
            name = self.grasp[int(rows[0])]
            if name in seen:
                place = self.source.key(f"grasp[{rows[0]}]")
                place.fail("each grasp's states together", f"{format_value(name)} again", "sort the states by grasp")
            seen.add(name)
            back = np.flatnonzero(np.diff(self.time_s[rows]) <= 0)
            if len(back):
                row = int(rows[back[0] + 1])
                found = f"{self.time_s[row]:.9g} after {self.time_s[row - 1]:.9g}"
                place = self.source.key(f"time[{row}]")
                place.fail("times that rise within a grasp", found, "sort the states, or label the grasps")
            for key, values in (("approach", self.approach), ("iteration", self.iteration), ("session", self.session)):
                for row in rows:
                    if values[row] != values[rows[0]]:
                        place = self.source.key(f"{key}[{row}]")
                        place.fail(
                            f"one {key} in a grasp", format_value(str(values[row])), "correct it, or name a new grasp"
                        )
        return parts


def read_states(path: str | os.PathLike[str], sizes: dict[str, tuple[int, ...]], step_s: float) -> RolloutStates:
    """Read an .npz of states. sizes: shape of one row of each of `STATES`. step_s: between states without times.

    Raises ImportDataError for the first mistake.
    """
    source = Source(os.fspath(path))
    arrays = _arrays(Path(path), source)
    for name in arrays:
        if name not in STATES + LABELS:
            near = near_names(name, STATES + LABELS)
            source.key(name).fail("an array of a known name", "an unknown one", f"rename it or leave it out ({near})")
    if "qpos" not in arrays:
        source.key("qpos").fail(f"an array [T, {sizes['qpos'][0]}]", "none", "save the states with numpy.savez")
    values = {name: _state(arrays[name], sizes[name], source.key(name)) for name in STATES if name in arrays}
    frames = len(values.get("ctrl", values["qpos"]))
    start_only = len(values["qpos"]) == 1 and frames > 1
    for name, value in values.items():
        if len(value) != frames and not (start_only and name in ("qpos", "qvel", "act")):
            source.key(name).fail(f"{frames} rows as the others", str(len(value)), "give one row for each state")
    labels = {name: _labels(arrays.get(name, default), frames, source.key(name)) for name, default in _DEFAULTS.items()}
    phase = [phase_number(value, source.key(f"phase[{row}]")) for row, value in enumerate(labels["phase"])]
    time = (
        _state(arrays["time"], (), source.key("time"))
        if "time" in arrays
        else np.asarray(step_s * np.arange(frames), np.float64)
    )
    if len(time) != frames:
        source.key("time").fail(f"{frames} times", str(len(time)), "give one for each state")
    iteration, session = (_integers(labels[name], source.key(name)) for name in ("iteration", "session"))
    grasp, approach = labels["grasp"], labels["approach"]
    result = RolloutStates(
        source, values, time, np.array(phase, np.uint8), grasp, approach, iteration, session, start_only
    )
    if start_only and len(result.grasps()) > 1:
        source.key("qpos").fail("a state in each row", "one row for several grasps", "give qpos [T, nq]")
    return result


def _arrays(path: Path, source: Source) -> dict[str, NDArray[Any]]:
    if not path.is_file():
        source.fail("an .npz file", "a folder" if path.is_dir() else "no such file", "check the path")
    try:
        with np.load(path, allow_pickle=False) as loaded:
            if not isinstance(loaded, np.lib.npyio.NpzFile):
                source.fail("an .npz file", "a single array", "save the states by name with numpy.savez")
            return {name: loaded[name] for name in loaded.files}
    except (ValueError, OSError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        reason = format_value(str(error).partition("\n")[0])
        source.fail("an .npz file of plain arrays", reason, "save numbers and texts with numpy.savez")


def _state(array: NDArray[Any], row: tuple[int, ...], place: Source) -> FloatArray:
    shape = ", ".join(["T", *map(str, row)])
    if array.dtype.kind not in "fiu" or array.shape[1:] != row or array.ndim != len(row) + 1 or not len(array):
        found = f"{array.dtype} {list(array.shape)}"
        place.fail(f"numbers [{shape}] as the model has", found, "save the states of that model")
    values = array.astype(np.float64)
    if not np.isfinite(values).all():
        at = [int(i) for i in np.argwhere(~np.isfinite(values))[0]]
        place.fail("finite numbers", f"{values[tuple(at)]} at {at}", "did the simulation diverge? leave that out")
    return values


def _labels(value: Any, frames: int, place: Source) -> list[str]:
    array = np.asarray(value)
    if array.ndim == 0:
        array = np.broadcast_to(array, (frames,))
    if array.shape != (frames,) or array.dtype.kind not in "Uiu":
        found = f"{array.dtype} {list(array.shape)}"
        place.fail(f"a name or a number for all states or each of {frames}", found, "give texts or integers")
    return [str(item) for item in array.tolist()]


def _integers(values: list[str], place: Source) -> NDArray[np.int64]:
    for row, value in enumerate(values):
        if not (value.isascii() and value.isdigit()):
            Source(place.file, f"{place.field}[{row}]").fail(
                "an integer of 0 or more", format_value(value), "count from 0"
            )
    return np.array(values, np.int64)
