"""Times at which two datasets are compared: each phase has bins, and each bin has nodes of equal length."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.recording.grasp_format import Phase

BINS_PER_PHASE: Final = {Phase.CLOSING: 4, Phase.HOLD: 1, Phase.RELEASE: 3, Phase.RECOVERY: 3}
"""Largest number of feature bins of each phase (chosen). A short phase has fewer bins."""

MAX_NODES_PER_PHASE: Final = {Phase.CLOSING: 12, Phase.HOLD: 6, Phase.RELEASE: 9, Phase.RECOVERY: 6}
"""Largest number of nodes of each phase (chosen): fine enough for an effect with a time constant of some tenths of a
second, and for a signal with a sharp beginning or end. All effects use the same nodes; otherwise an effect with a finer
time grid would be selected only because its grid fits sharp edges better than means over bins."""

MIN_FRAMES_PER_NODE: Final = 1.5
"""Smallest number of frames of the slower recording in a node, so that almost every node contains a frame of each board
that sends at the recorded rate. A larger value makes the time grid coarser."""

EQUAL_DURATION_RATIO: Final = 1.15
"""Ratio of the longest duration of a phase, limited by `MAX_DURATION_RATIO`, to the shortest duration, below which the
durations are treated as equal (chosen): the shortest duration is then evaluated for all conditions."""

MAX_DURATION_RATIO: Final = 1.5
"""Largest ratio of the evaluated duration of a phase to the median duration (chosen). Without this limit, a single
longer contact would make the bins too wide for all other contacts."""


def choose_duration(durations: NDArray[np.float64]) -> float:
    """Return the duration of a phase that is evaluated for all conditions, seconds.

    durations: f64[C] (C conditions), duration of the phase in the shortest grasp of each condition, seconds. The result
    is the longest of these durations, limited to `MAX_DURATION_RATIO` times their median. If the limited duration is
    less than `EQUAL_DURATION_RATIO` times the shortest duration, the result is the shortest duration.
    """
    limited = min(float(durations.max()), MAX_DURATION_RATIO * float(np.median(durations)))
    return float(durations.min()) if limited < EQUAL_DURATION_RATIO * durations.min() else limited


@dataclass(frozen=True, eq=False)
class TimeGrid:
    """K time nodes, divided into B feature bins. A node is an interval over which the frames of a grasp are averaged.

    Attributes:
        phase: u8[K], phase of each node.
        begin, end: f64[K], seconds from the beginning of the phase; the nodes of a phase are contiguous.
        bins: phase and nodes of each of the B bins.
    """

    phase: NDArray[np.uint8]
    begin: NDArray[np.float64]
    end: NDArray[np.float64]
    bins: tuple[tuple[Phase, slice], ...]

    @classmethod
    def from_durations(cls, durations: dict[Phase, float], rate_hz: float) -> TimeGrid:
        """Return the time nodes of phases with the given evaluated durations. A phase without a duration has no nodes.

        Each phase is divided into equal bins, and each bin into equal nodes; a node is the interval over which frames
        are averaged, and contains about `MIN_FRAMES_PER_NODE` frames or more.

        durations: seconds of each phase. rate_hz: frame rate of the slower recording.
        """
        phases: list[int] = []
        begins: list[float] = []
        ends: list[float] = []
        bins: list[tuple[Phase, slice]] = []
        for phase, max_bins in BINS_PER_PHASE.items():
            if phase not in durations:
                continue
            frames = durations[phase] * rate_hz / MIN_FRAMES_PER_NODE
            count = max(1, min(max_bins, int(frames)))
            bin_nodes = max(1, min(MAX_NODES_PER_PHASE[phase] // max_bins, int(frames / count)))
            edges = np.linspace(0.0, durations[phase], count * bin_nodes + 1)
            for k in range(count):
                first = len(phases) + k * bin_nodes
                bins.append((phase, slice(first, first + bin_nodes)))
            phases += [int(phase)] * (count * bin_nodes)
            begins += edges[:-1].tolist()
            ends += edges[1:].tolist()
        return cls(np.array(phases, np.uint8), np.array(begins), np.array(ends), tuple(bins))

    def find_nodes_beyond(self, durations: Mapping[Phase, NDArray[np.float64]]) -> NDArray[np.bool_]:
        """Return for each condition the nodes of the bins that end after its shortest grasp, bool[C, K] (C conditions,
        K time nodes).

        durations: for each phase, the duration in the shortest grasp of each condition, f64[C], seconds.
        """
        result = np.zeros((len(next(iter(durations.values()))), self.node_count), bool)
        for phase, nodes in self.bins:
            result[:, nodes] = (self.end[nodes.stop - 1] > durations[phase] + 1e-9)[:, None]
        return result

    @property
    def node_count(self) -> int:
        """Number K of nodes."""
        return len(self.phase)

    @cached_property
    def time_since_start_s(self) -> NDArray[np.float64]:
        """Middle of each node, seconds from the beginning of the first phase, f64[K] (K time nodes)."""
        offset, total = np.zeros(self.node_count), 0.0
        for phase in dict.fromkeys(self.phase.tolist()):
            in_phase = self.phase == phase
            offset[in_phase] = total
            total += float(self.end[in_phase].max())
        return np.asarray(offset + 0.5 * (self.begin + self.end))

    @cached_property
    def bin_grid(self) -> TimeGrid:
        """Time grid with one node for each bin; it has the same bins."""
        first = np.array([nodes.start for _, nodes in self.bins])
        last = np.array([nodes.stop - 1 for _, nodes in self.bins])
        bins = tuple((phase, slice(row, row + 1)) for row, (phase, _) in enumerate(self.bins))
        return TimeGrid(self.phase[first], self.begin[first], self.end[last], bins)

    @cached_property
    def bin_averages(self) -> NDArray[np.float64]:
        """Matrix that averages the values at the nodes over each bin, f64[B, K] (B time bins, K time nodes)."""
        matrix = np.zeros((len(self.bins), self.node_count))
        for row, (_, nodes) in enumerate(self.bins):
            matrix[row, nodes] = 1.0 / (nodes.stop - nodes.start)
        return matrix

    def find_bins(self, phase: Phase) -> NDArray[np.intp]:
        """Return the indices of the bins of a phase."""
        return np.array([row for row, (bin_phase, _) in enumerate(self.bins) if bin_phase == phase], dtype=np.intp)
