"""Size of a change in counts."""

from __future__ import annotations

import numpy as np

from taxel.twin.reference import Reference
from taxel.twin.statistics import Quantity
from taxel.twin.steps import CLOSING, HOLD


def compute_size(reference: Reference, quantity: Quantity, place: int, amplitude: float) -> float | None:
    """Convert the amplitude of a change to counts; None for a quantity that does not change counts.

    place: index in `Places`. A change of gain or recovery is the amplitude times the largest expected signal at the
    place. A delay changes the signal by minus the delay times the steepest rise in the closing phase. The amplitude of
    a change of the noise is the natural logarithm of the ratio of the variances; its size in counts is the change of
    the standard deviation.
    """
    members = reference.places.members
    taxels = members.indices[members.indptr[place] : members.indptr[place + 1]]
    if quantity.unit == "counts":
        return amplitude
    if quantity.name in ("gain", "recovery"):
        return amplitude * max(float(one.mean[HOLD][:, taxels].max()) for one in reference.conditions.values())
    if quantity.name == "delay":
        rise = max(float(np.diff(one.mean[CLOSING][:, taxels], axis=0).max()) for one in reference.conditions.values())
        times = [step.contact.times_s for _, step in reference.steps if step.contact is not None]
        width = float(np.median([end - begin for begin, end, *_ in times])) / (CLOSING.stop - CLOSING.start)
        return -amplitude * rise / width
    if quantity.name == "noise":
        sigma = float(np.sqrt(reference.noise_variance[taxels].max()))
        return sigma * (float(np.exp(0.5 * amplitude)) - 1.0)
    return None
