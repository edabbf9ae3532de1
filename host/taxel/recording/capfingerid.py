"""Measured touches on a touch panel of 27 x 15 cells: the CapFingerId recordings (see data/capfingerid.ORIGIN)."""

from dataclasses import dataclass
from importlib.resources import files
from io import BytesIO

import numpy as np
from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

from taxel.recording.errors import RecordingError
from taxel.types import FloatArray

ROWS = 27
COLUMNS = 15
"""Cells of the panel (Le, Mayer and Henze 2019, doi 10.1145/3301275.3302295)."""

_FILE = "capfingerid.npz"
_VALUES = ".values"


@dataclass(frozen=True, eq=False)
class TouchRecording:
    """Frames of a touch panel.

    name: such as "P2_index_right".
    time_s: f64[T], seconds since the first frame, not decreasing.
    values: int16[T, 27, 15], counts above the baseline; a touch raises the value.
    task: str[T], task of the participant: TAP, SCROLL, DRAG or PAUSE.

    Raises ValueError for inconsistent shapes or decreasing times.
    """

    name: str
    time_s: FloatArray
    values: NDArray[np.int16]
    task: NDArray[np.str_]

    def __post_init__(self) -> None:
        """Check the shapes of the arrays of the touch recording and the order of its times."""
        frames = len(self.values)
        if self.values.shape != (frames, ROWS, COLUMNS) or self.values.dtype != np.int16:
            raise ValueError(f"values: expected int16 [T, 27, 15], found {self.values.dtype} {self.values.shape}")
        if self.time_s.shape != (frames,) or self.task.shape != (frames,):
            raise ValueError(f"time_s and task: expected [{frames}], found {self.time_s.shape} and {self.task.shape}")
        if not np.isfinite(self.time_s).all() or (np.diff(self.time_s) < 0.0).any():
            raise ValueError("time_s: expected finite times that do not decrease")

    @property
    def duration_s(self) -> float:
        """Seconds from the first frame to the last; 0 without frames."""
        return float(self.time_s[-1] - self.time_s[0]) if len(self.time_s) else 0.0

    def between(self, start_s: float, stop_s: float) -> "TouchRecording":
        """Return the frames with start_s <= time < stop_s of the touch recording, with their original times."""
        frames = slice(*np.searchsorted(self.time_s, [start_s, stop_s]).tolist())
        return TouchRecording(self.name, self.time_s[frames], self.values[frames], self.task[frames])


def list_recordings() -> list[str]:
    """Return the sorted names of the touch recordings that are part of the package."""
    with _open_archive() as archive:
        return sorted(name.removesuffix(_VALUES) for name in archive.files if name.endswith(_VALUES))


def load_recording(name: str) -> TouchRecording:
    """Load a touch recording that is part of the package by its name. Raises `RecordingError` for an unknown name."""
    available = list_recordings()
    if name not in available:
        raise RecordingError(f"recording {name!r}: expected one of {', '.join(available)}")
    with _open_archive() as archive:
        return TouchRecording(name, archive[f"{name}.time_s"], archive[f"{name}{_VALUES}"], archive[f"{name}.task"])


def _open_archive() -> NpzFile:
    """Open the .npz archive of touch recordings that is part of the package."""
    data = files("taxel.recording").joinpath("data", _FILE).read_bytes()
    archive: NpzFile = np.load(BytesIO(data), allow_pickle=False)
    return archive
