"""Components of the floor of a campaign on the emulated hand: one source of variation at a time.

The floor of a condition (object and approach) is the standard error of its mean signal over the sessions: the gap that
repeats alone cause. The random samples of a source are those of the full variation (equal seed and grasp ids), so that
the sum of the components and the floor of the full variation are estimated from the same samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Final

import numpy as np
from scipy.stats import chi2

from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.variation import NO_VARIATION
from taxel.cloud.contacts import count_baseline_frames, select_used_taxels
from taxel.grasp.plan import PlannedGrasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.types import BoolArray, FloatArray

ALL: Final = "all"
"""Name of the dataset in which all sources vary at the same time."""

SOURCES: Final[Mapping[str, tuple[str, ...]]] = {
    "object pose": ("object_m", "object_rad"),
    "grip": ("grip",),
    "mounting": ("remount_m", "remount_rad"),
    "finger bases": (),
    "noise": (),
}
"""Sources of variation, and the fields of `Variation` that belong to them. Finger bases: the original plan holds the
first joint of each finger at the angle that was measured in the original experiment's iteration with the same number.
Noise: read-out noise of the taxels.
"""

SIGNAL_COUNTS: Final = 10.0
"""Mean signal, in counts, above which a taxel is included: 2.5 standard deviations of one frame's default noise."""

CONFIDENCE: Final = 0.9
"""Probability that the interval of a floor contains the true floor (chosen)."""

Key = tuple[str, str]
"""Names of an object and an approach."""


@dataclass(frozen=True)
class FloorComponents:
    """Floor of one condition or of several pooled conditions, counts, RMS over the taxels with a signal.

    taxels: number of these taxels. components: floor of each source alone, by name of the source. total: floor of the
    full variation. interval: lower and upper end of the confidence interval of `total` (level `CONFIDENCE`).
    """

    taxels: int
    components: Mapping[str, float]
    total: float
    interval: tuple[float, float]

    @property
    def sum(self) -> float:
        """Root of the sum of the squared components: the floor if the sources act independently and linearly."""
        return float(np.sqrt(sum(value**2 for value in self.components.values())))


def isolate_source(settings: EmulatedSettings, source: str) -> EmulatedSettings:
    """Return the settings in which only one source varies. source: a key of `SOURCES`, or `ALL` for no change.

    Effects other than noise are kept; noise is kept only for the source "noise". Raises KeyError for another source.
    """
    if source == ALL:
        return settings
    kept = {name: getattr(settings.variation, name) for name in SOURCES[source]}
    variation = replace(NO_VARIATION, objects=settings.variation.objects, **kept)
    if source == "noise":
        return replace(settings, variation=variation)
    effects = tuple(line for line in settings.effects if line.split()[0] != "noise")
    return replace(settings, variation=variation, effects=effects, noise_counts=0.0)


def select_grasps(plan: Sequence[PlannedGrasp], keys: Sequence[Key], source: str) -> tuple[PlannedGrasp, ...]:
    """Select the first grasp of each condition in each session, in the order of the plan.

    keys: conditions to select. The iteration number of the selected grasps, which determines the finger bases, is set
    to 0, so that all finger bases are equal; it is kept if `source` is "finger bases" or `ALL`.
    """
    first: dict[tuple[str, str, int], PlannedGrasp] = {}
    for grasp in plan:
        if (grasp.object, grasp.approach) in keys:
            first.setdefault((grasp.object, grasp.approach, grasp.session), grasp)
    if source in (ALL, "finger bases"):
        return tuple(first.values())
    return tuple(replace(grasp, iteration=0) for grasp in first.values())


def read_session_means(path: str | PathLike[str]) -> tuple[dict[Key, FloatArray], BoolArray]:
    """Read the mean signals of each session of a dataset, and which of its n taxels the thesis experiments used.

    The first value maps each condition to the signals of its S sessions, f64[S, n], counts: means over the hold and
    over the session's grasps. The second value is bool[n].
    """
    signals: dict[Key, dict[int, list[FloatArray]]] = {}
    with GraspDataset(path) as data:
        for grasp in data:
            signal = grasp.mean_hold_signal(count_baseline_frames(grasp))
            signals.setdefault((grasp.object, grasp.approach), {}).setdefault(grasp.session, []).append(signal)
        used = select_used_taxels(data)
    return {
        key: np.stack([np.mean(grasps, axis=0) for grasps in sessions.values()]) for key, sessions in signals.items()
    }, used


def compute_components(paths: Mapping[str, str | PathLike[str]]) -> dict[Key, FloorComponents]:
    """Compute the components of the floor from the datasets of all sources, by condition.

    paths: dataset of each source and of `ALL`, with two or more sessions. The floor of a condition is the standard
    error of its mean signal over the sessions. Only used taxels whose mean signal in the dataset `ALL` exceeds
    `SIGNAL_COUNTS` are included.
    """
    means = {source: read_session_means(path) for source, path in paths.items()}
    full, used = means[ALL]
    result = {}
    for key, sessions in full.items():
        has_signal = used & (sessions.mean(axis=0) > SIGNAL_COUNTS)
        floors = {source: _compute_floor(by_key[key][:, has_signal]) for source, (by_key, _) in means.items()}
        total = floors.pop(ALL)
        interval = _compute_interval(total, len(sessions) - 1)
        result[key] = FloorComponents(int(has_signal.sum()), floors, total, interval)
    return result


def pool(parts: Sequence[FloorComponents], sessions: int) -> FloorComponents:
    """Pool the floors of several conditions to one: root mean square of the totals and of each component.

    The number of taxels is the sum over the conditions. sessions: number of sessions of each condition, from which the
    confidence interval follows. `parts` is not empty.
    """
    components = {source: _pool_rms([part.components[source] for part in parts]) for source in parts[0].components}
    total = _pool_rms([part.total for part in parts])
    interval = _compute_interval(total, len(parts) * (sessions - 1))
    return FloorComponents(sum(part.taxels for part in parts), components, total, interval)


def _compute_floor(sessions: FloatArray) -> float:
    """Compute the standard error of the mean over S sessions, RMS over n taxels. sessions: f64[S, n], counts."""
    return float(np.sqrt(np.mean(sessions.var(axis=0, ddof=1)) / len(sessions)))


def _compute_interval(floor: float, degrees_of_freedom: int) -> tuple[float, float]:
    """Compute the confidence interval (lower, upper end) of a floor from the chi-squared distribution of its square.

    The signals of a condition's taxels vary together. Each session is therefore treated as one sample, whatever the
    number of taxels: the interval is too wide rather than too narrow.
    """
    shares = (1.0 + CONFIDENCE) / 2.0, (1.0 - CONFIDENCE) / 2.0
    low, high = (floor * np.sqrt(degrees_of_freedom / chi2.ppf(share, degrees_of_freedom)) for share in shares)
    return float(low), float(high)


def _pool_rms(values: Sequence[float]) -> float:
    """Compute the root mean square of the values."""
    return float(np.sqrt(np.mean(np.square(values))))
