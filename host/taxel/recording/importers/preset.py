"""Options that all presets (importers of files of a known layout) share, and arrays with several environments."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from taxel.recording.general.format import AXES
from taxel.recording.grasp_checks import Location
from taxel.recording.importers.contacts import Recording
from taxel.recording.importers.fields import Source
from taxel.recording.importers.mapping import Grouping, Labels
from taxel.recording.importers.selection import read_times
from taxel.recording.importers.times import find_times
from taxel.types import FloatArray


@dataclass(frozen=True)
class PresetOptions:
    """Options of every preset, an importer of files of a known layout.

    labels: constant labels of all contacts. grouping: division into contacts. time_unit: unit of the times; None:
    inferred. rate_hz: frame rate of a file without times, hertz.
    """

    labels: Labels = field(default_factory=Labels)
    grouping: Grouping = field(default_factory=Grouping)
    time_unit: str | None = None
    rate_hz: float | None = None


def read_preset_times(source: Source, frames: int, options: PresetOptions) -> FloatArray:
    """Return the times of a file of a known layout, f64[T], seconds from its first frame.

    frames: number T of frames. Raises DatasetError if the file has no times and the options give no rate.
    """
    return read_times(source, find_times(source, frames, options.time_unit, options.rate_hz), frames)


def split_environments(values: FloatArray, time: FloatArray, location: Location, labels: Labels) -> Iterator[Recording]:
    """Yield one recording for each environment. values: f64[T, e, n] or f64[T, e, n, 3] of e environments."""
    for index in range(values.shape[1]):
        yield Recording(location, time, np.ascontiguousarray(values[:, index]), labels)


def join_components(shear: FloatArray, normal: FloatArray) -> FloatArray:
    """Join shear [..., 2] and normal component [...] to vectors [..., 3]: the third component is the normal one."""
    joined = np.concatenate([shear, normal[..., None]], axis=-1)
    assert joined.shape[-1] == AXES
    return joined
