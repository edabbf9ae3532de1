"""At which times two datasets are looked at: nodes of equal length since a phase began, and bins of nodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.recording.grasp_format import Phase

BINS: Final = {Phase.CLOSING: 4, Phase.HOLD: 1, Phase.RELEASE: 3, Phase.RECOVERY: 3}
"""Feature bins of each phase: "a few"."""

NODES: Final = {Phase.CLOSING: 12, Phase.HOLD: 6, Phase.RELEASE: 9, Phase.RECOVERY: 6}
"""Most nodes of each phase: fine enough for an effect with a memory of some tenths of a second, and for what
ends or begins sharply. All effects have the same ones: on means of bins a sharp end fits worse, and whatever would have
brought nodes along would have been named for that."""

FRAMES_PER_NODE: Final = 1.5
"""So that hardly a node is without a frame of a board that sends at the recorded rate."""


ALL_ALIKE: Final = 1.15
"""Longest over shortest duration of a phase, up to which all presses are looked at as long as the shortest lasts."""

MOST_DURATION: Final = 1.5
"""Median durations, beyond which nobody looks: one press that lasts longer would make the bins too wide for the others.
"""


def usual_duration(lasts: NDArray[np.float64]) -> float:
    """Seconds of a phase that are looked at. lasts: of each cell, f64[C]."""
    most = min(float(lasts.max()), MOST_DURATION * float(np.median(lasts)))
    return float(lasts.min()) if most < ALL_ALIKE * lasts.min() else most


@dataclass(frozen=True, eq=False)
class Clock:
    """K nodes of time.

    Attributes:
        phase: u8[K]. begin, end: f64[K], seconds since the phase began; the nodes of a phase follow each other.
        bins: for each of B feature bins, its phase and the nodes in it.
    """

    phase: NDArray[np.uint8]
    begin: NDArray[np.float64]
    end: NDArray[np.float64]
    bins: tuple[tuple[Phase, slice], ...]

    @classmethod
    def of(cls, durations: dict[Phase, float], rate_hz: float) -> Clock:
        """durations: seconds of each phase that are looked at. rate_hz: of the slower one."""
        phases: list[int] = []
        begins: list[float] = []
        ends: list[float] = []
        bins: list[tuple[Phase, slice]] = []
        for phase, wanted in BINS.items():
            if phase not in durations:
                continue
            frames = durations[phase] * rate_hz / FRAMES_PER_NODE
            count = max(1, min(wanted, int(frames)))
            each = max(1, min(NODES[phase] // wanted, int(frames / count)))
            edges = np.linspace(0.0, durations[phase], count * each + 1)
            for k in range(count):
                first = len(phases) + k * each
                bins.append((phase, slice(first, first + each)))
            phases += [int(phase)] * (count * each)
            begins += edges[:-1].tolist()
            ends += edges[1:].tolist()
        return cls(np.array(phases, np.uint8), np.array(begins), np.array(ends), tuple(bins))

    def beyond(self, lasts: Mapping[Phase, NDArray[np.float64]]) -> NDArray[np.bool_]:
        """Nodes of bins to whose end a cell's grasps do not last, bool[C, K]. lasts: seconds of each phase that all
        grasps of a cell have, f64[C].
        """
        result = np.zeros((len(next(iter(lasts.values()))), self.nodes), bool)
        for phase, own in self.bins:
            result[:, own] = (self.end[own.stop - 1] > lasts[phase] + 1e-9)[:, None]
        return result

    @property
    def nodes(self) -> int:
        """K."""
        return len(self.phase)

    @cached_property
    def since_start(self) -> NDArray[np.float64]:
        """Middle of each node, seconds from the beginning of the first phase, f64[K]."""
        offset, total = np.zeros(self.nodes), 0.0
        for phase in dict.fromkeys(self.phase.tolist()):
            own = self.phase == phase
            offset[own] = total
            total += float(self.end[own].max())
        return np.asarray(offset + 0.5 * (self.begin + self.end))

    @cached_property
    def of_bins(self) -> Clock:
        """One node a bin."""
        first = np.array([own.start for _, own in self.bins])
        last = np.array([own.stop - 1 for _, own in self.bins])
        bins = tuple((phase, slice(row, row + 1)) for row, (phase, _) in enumerate(self.bins))
        return Clock(self.phase[first], self.begin[first], self.end[last], bins)

    @cached_property
    def to_bins(self) -> NDArray[np.float64]:
        """Means over the nodes of each bin, f64[B, K]."""
        matrix = np.zeros((len(self.bins), self.nodes))
        for row, (_, nodes) in enumerate(self.bins):
            matrix[row, nodes] = 1.0 / (nodes.stop - nodes.start)
        return matrix

    def bins_of(self, phase: Phase) -> NDArray[np.intp]:
        """Which bins are of a phase."""
        return np.array([row for row, (own, _) in enumerate(self.bins) if own == phase], dtype=np.intp)
