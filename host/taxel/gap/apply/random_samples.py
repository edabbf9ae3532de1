"""Random deviations of the effects on a simulated grasp: noise, drift that differs between grasps, lost frames.

Random samples are balanced among the repeats of a condition. Two repeats (the last three of an odd number) form a group
whose samples have the sum zero, and each sample alone keeps its full variance. Otherwise the random samples would move
the mean of the few repeats, and the next diagnosis would report this change as a gap.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.reading import MIN_BASELINE_FRAMES, GraspPhases, TaxelGroups
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

NOISE_STREAM: Final = 1
DRIFT_STREAM: Final = 2
LOSS_STREAM: Final = 3
"""Keys of the random streams. Separate streams ensure that one effect does not change the samples of another effect."""


@dataclass(frozen=True)
class RandomStreams:
    """Random streams of one grasp.

    Attributes:
        seed: seed of the dataset.
        condition: number of the condition of the grasp.
        repeat: number of the grasp among the grasps of this condition, from 0.
        repeats: number of grasps of this condition.
    """

    seed: int
    condition: int
    repeat: int
    repeats: int

    def create_stream(self, *stream_key: int) -> np.random.Generator:
        """Return the random generator of this grasp for a stream key, such as (`LOSS_STREAM`, board)."""
        return self._create_stream(self.repeat, *stream_key)

    def sample_balanced(self, sample: Callable[[np.random.Generator], FloatArray], *stream_key: int) -> FloatArray:
        """Return the sample of this grasp, balanced with the samples of the other repeats of its group: their sum is 0.

        sample: function that returns independent values from a random generator; it is called once for each of the two
        or three repeats of the group. A grasp without other repeats gets an unbalanced sample. stream_key: key of the
        random stream.
        """
        group = min(self.repeat // 2, max(self.repeats // 2, 1) - 1)  # pairs of repeats; the last group may have three
        first = 2 * group
        last = first + 2 if first + 4 <= self.repeats else self.repeats
        samples = [sample(self._create_stream(number, *stream_key)) for number in range(first, last)]
        own_sample = samples[self.repeat - first]
        count = len(samples)
        if count == 1:
            return own_sample
        # The factor restores the variance that the subtraction of the mean removes.
        return np.asarray(np.sqrt(count / (count - 1.0)) * (own_sample - np.mean(samples, axis=0)))

    def _create_stream(self, repeat: int, *stream_key: int) -> np.random.Generator:
        """Return the random generator of a repeat of this condition for a stream key."""
        return np.random.default_rng([self.seed, self.condition, repeat, *stream_key])


def sample_noise(deviations: FloatArray, groups: TaxelGroups, frames: int, streams: RandomStreams) -> FloatArray:
    """Return noise in counts for each frame and taxel, f64[T, n] (n taxels).

    deviations: f64[4, n], counts, standard deviations of the white noise of each taxel and of the noise common to its
    TX line, its RX line and its board. groups: lines and boards of the taxels. frames: number T of frames. streams:
    random numbers of the grasp.
    """
    result = np.zeros((frames, deviations.shape[1]))
    each_taxel = np.arange(deviations.shape[1])
    for component, (deviation, group) in enumerate(
        zip(deviations, (each_taxel, groups.tx, groups.rx, groups.sensor), strict=True)
    ):
        if deviation.any():
            shape = (frames, int(group.max()) + 1)
            result += (
                deviation * streams.sample_balanced(partial(_sample_normal, shape), NOISE_STREAM, component)[:, group]
            )
    return result


def _sample_normal(shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
    """Return an array of independent standard normal numbers."""
    return rng.normal(size=shape)


def sample_drift(
    values: FloatArray, measured_share: float, relative_duration: float, streams: RandomStreams
) -> FloatArray:
    """Return the values of a baseline drift for one grasp, f64[2, G] (G blocks: the hand, boards, objects or taxels),
    counts: a sampled slope, and deviation 0.

    values: f64[2, G], counts, mean slope and standard deviation between grasps. measured_share: mean share of the slope
    that is reached in the phase in which the standard deviation was measured; the division by this share converts the
    deviation to the end of the drift. relative_duration: duration of the grasp divided by the time over which the slope
    was fitted.
    """
    sample = streams.sample_balanced(partial(_sample_normal, values.shape[1:]), DRIFT_STREAM)
    return np.stack([values[0] * relative_duration + values[1] * sample / measured_share, np.zeros(values.shape[1])])


def remove_lost_frames(
    grasp: GraspPhases, valid: NDArray[np.bool_], missing: FloatArray, streams: RandomStreams
) -> NDArray[np.bool_]:
    """Return the frames that still arrive after random losses, bool[T, s] (T frames).

    valid: bool[T, s], frames that arrive without the losses. missing: f64[s], additional lost frames of each board as a
    share of all frames. A board keeps its first `MIN_BASELINE_FRAMES` baseline frames, because its signal is unknown
    without a baseline, unless all its frames are lost.
    """
    result = valid.copy()
    frames = len(valid)
    for board in np.flatnonzero(missing > 0.0):
        rng = streams.create_stream(LOSS_STREAM, int(board))
        arrived = np.flatnonzero(valid[:, board])
        count = int(missing[board] * frames + rng.random())  # random rounding keeps the mean share
        if count < len(arrived):
            kept = arrived[grasp.phase[arrived] == Phase.BASELINE][:MIN_BASELINE_FRAMES]
            arrived = rng.permutation(np.setdiff1d(arrived, kept))
        result[arrived[:count], board] = False
    return result


def repeat_last_counts(
    raw: NDArray[np.uint16], valid: NDArray[np.bool_], sensor: NDArray[np.intp]
) -> NDArray[np.uint16]:
    """Return counts u16[T, n] (T frames, n taxels) in which a lost frame repeats the last frame that arrived; 0 before
    the first frame.

    raw: u16[T, n], counts of all frames. valid: bool[T, s], frames of each board that arrived. sensor: [n], column of
    each taxel's board in `valid`.
    """
    # The running maximum of the rows of arrived frames is, at each frame, the row of the last frame that arrived.
    row = np.where(valid, np.arange(len(valid))[:, None], -1)
    last_row = np.maximum.accumulate(row, axis=0)[:, sensor]
    return np.where(last_row >= 0, np.take_along_axis(raw, np.maximum(last_row, 0), axis=0), 0).astype(np.uint16)
