"""Location of a remainder: boards, lines or taxels that deviate in every condition while others do not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.missing_inputs import LINES
from taxel.gap.data.pair import Pair
from taxel.gap.features.features import compute_mean_product
from taxel.gap.localisation.signature.distortions import BOARD, COLUMN, HAND, ROW, TAXEL, get_groups
from taxel.gap.localisation.signature.fit import Remainder, compute_p_value
from taxel.types import FloatArray

MAX_LOCATIONS: Final = {TAXEL: 3, ROW: 2, COLUMN: 2, BOARD: 2}
"""Largest number of locations of each kind that are named together. Chosen for two exchanged lines and a few taxels."""

MIN_SHARE: Final = 0.15
"""Smallest share of the excess that a conspicuous location contains. Chosen."""

MIN_RATIO: Final = 3.0
"""Smallest ratio of a location's share of the excess to its share of the signal energy. Chosen: a residual that only
follows the signal has the ratio 1."""

MIN_BOARD_RATIO: Final = 1.5
"""Smallest ratio like `MIN_RATIO` for the boards of a distortion that was fitted to the whole hand. Chosen."""

MIN_CONSISTENT_SHARE: Final = 0.6
"""Smallest share of a location's signal energy in taxels and conditions with the deviation; also the smallest share of
an explained excess that the named locations contain. Chosen: the greater part."""


@dataclass(frozen=True, eq=False)
class LocalDeviation:
    """Conspicuous locations of one kind: boards, TX lines, RX lines or taxels with an excess out of proportion.

    scope: kind of the locations. groups: numbers of the locations, as in `get_groups`. excess_by_taxel: f64[n] (n
    taxels), excess of the signal at these locations, counts^2; 0 elsewhere. gram: f64[S, S], products of the residuals
    of each pair of sessions at these locations, counts^2. p_value: corrected for the number of locations of this kind;
    None below 3 sessions. has_one_condition: whether only one condition loads the locations.
    """

    scope: str
    groups: tuple[int, ...]
    excess_by_taxel: FloatArray
    gram: FloatArray
    p_value: float | None
    has_one_condition: bool


def compute_signal_energy(remainder: Remainder, model: FloatArray, bins: int) -> FloatArray:
    """Return the weighted sum of squared predicted and squared real signals, counts^2, f64[C, n] (C conditions, n
    taxels).

    model: f64[C, F, n] (F features), predicted features. bins: B, number of signal features.
    """
    known = remainder.known[:, :, :bins].any(axis=1)
    count = np.maximum(remainder.known[:, :, :bins].sum(axis=1), 1)
    real = remainder.residual[:, :, :bins].sum(axis=1) / count + np.nan_to_num(model[:, :bins])
    squares = np.where(known, np.nan_to_num(model[:, :bins]) ** 2 + real**2, 0.0)
    return np.asarray((squares * remainder.root_weight[:bins] ** 2).sum(axis=1))


def find_local_deviations(remainder: Remainder, model: FloatArray, bins: int) -> list[LocalDeviation]:
    """Find conspicuous taxels, lines and boards: locations with more of the remainder than their signals account for.

    The result contains at most one deviation for each kind of location, which can name several locations.

    model: f64[C, F, n] (C conditions, F features, n taxels), predicted features. bins: B, number of signal features.
    """
    scaled = remainder.residual[:, :, :bins] * remainder.root_weight[:bins]
    excess = _compute_excess(scaled, remainder.known[:, :, :bins].sum(axis=1))
    whole, energy = float(excess.sum()), compute_signal_energy(remainder, model, bins)
    if whole <= 0:
        return []
    scopes = (TAXEL, BOARD) if LINES in remainder.pair.missing_inputs else tuple(MAX_LOCATIONS)
    deviations = [_find_in_scope(remainder, scope, scaled, excess, energy) for scope in scopes]
    return [deviation for deviation in deviations if deviation is not None]


def _compute_excess(scaled: FloatArray, count: NDArray[np.intp]) -> FloatArray:
    """Return the squared residual of each condition and taxel without the contribution of noise, counts^2, f64[C, n] (C
    conditions, n taxels), summed over the time bins.

    The mean product of two different sessions contains no square of noise. With one session the noise cannot be
    removed, and the result is the sum of the squares. scaled: f64[C, S, B, n] (S sessions, B time bins), weighted
    residuals. count: [C, B, n], number of sessions with this feature.
    """
    squares = np.square(scaled).sum(axis=1)
    if scaled.shape[1] < 2:
        return np.asarray(squares.sum(axis=1))
    return np.asarray(compute_mean_product(scaled.sum(axis=1), squares, count).sum(axis=1))


def _find_in_scope(
    remainder: Remainder, scope: str, scaled: FloatArray, excess: FloatArray, energy: FloatArray
) -> LocalDeviation | None:
    """Return the conspicuous locations of one kind (`scope`), or None if no location is conspicuous.

    A conspicuous location contains a large share of the excess, and at least `MIN_RATIO` times its share of the signal
    energy. A conspicuous line or board also deviates in most of its taxels and conditions.

    scaled: f64[C, S, B, n] (C conditions, S sessions, B time bins, n taxels), weighted residuals of the signal. excess:
    f64[C, n], counts^2. energy: f64[C, n], weighted squared signals, counts^2.
    """
    group = get_groups(remainder.pair, scope)
    count = int(group.max()) + 1
    share = np.bincount(group, excess.sum(axis=0), count) / excess.sum()
    expected = np.bincount(group, energy.sum(axis=0), count) / max(float(energy.sum()), 1e-30)
    chosen = []
    for number in np.argsort(-share)[: MAX_LOCATIONS[scope]]:
        taxels = np.flatnonzero(group == number)
        stands_out = share[number] >= max(MIN_SHARE, MIN_RATIO * expected[number])
        if stands_out and (scope == TAXEL or _is_consistent(excess[:, taxels], energy[:, taxels])):
            chosen.append(int(number))
    if not chosen:
        return None
    here = np.isin(group, chosen)
    gram = remainder.complete_products(np.einsum("csfn,ctfn->st", scaled[..., here], scaled[..., here], optimize=True))
    p = compute_p_value(gram)
    by_condition = energy[:, here].sum(axis=1)
    # Conditions with less than a tenth of the largest signal energy hardly load the location.
    has_one_condition = bool((by_condition > 0.1 * by_condition.max()).sum() == 1)
    corrected = None if p is None else min(1.0, p * count)
    by_taxel = np.where(here, excess.sum(axis=0), 0.0)
    return LocalDeviation(scope, tuple(chosen), by_taxel, gram, corrected, has_one_condition)


def _is_consistent(excess: FloatArray, energy: FloatArray) -> bool:
    """Return whether most taxels and conditions of a location have the deviation.

    excess, energy: f64[C, m] (C conditions), excess and signal energy (weighted squared signals) of the m taxels of the
    location, counts^2. A taxel in a condition has the deviation if its ratio of excess to signal energy is at least a
    quarter of the ratio of the location. At least two taxels must have more than 5 % of the signal energy of the
    location.
    """
    whole = float(energy.sum())
    if whole <= 0:
        return False
    deviates = excess >= 0.25 * float(excess.sum()) / whole * energy
    is_loaded = energy.sum(axis=0) > 0.05 * whole
    return bool(is_loaded.sum() >= 2 and energy[deviates].sum() >= MIN_CONSISTENT_SHARE * whole)


def locate_explained_part(
    pair: Pair, explained: FloatArray, energy: FloatArray, scope: str
) -> tuple[str, list[tuple[int, float]]]:
    """Return the kind of location that contains most of an explained excess, and its locations, largest share first.

    The locations are pairs of location number (as in `get_groups`) and share of the explained excess. If groups of
    taxels have their own coefficients, the groups with a share of at least 10 % are returned. If the coefficients apply
    to the whole hand, lines and boards are searched; if a few of them do not contain most of the excess, the kind is
    the hand, without locations.

    explained: f64[n] (n taxels), explained excess, counts^2. energy: f64[n], signal energy (weighted squared signals),
    counts^2. scope: kind of groups that share coefficients.
    """
    if scope != HAND:
        return scope, _list_largest(explained, get_groups(pair, scope), 0.1)
    for kind in (BOARD,) if LINES in pair.missing_inputs else (ROW, COLUMN, BOARD):
        group = get_groups(pair, kind)
        share, expected = (
            _compute_shares(np.bincount(group, values).astype(np.float64)) for values in (explained, energy)
        )
        top = np.argsort(-share)[: MAX_LOCATIONS[kind]]
        top = top[share[top] >= MIN_SHARE]
        ratio = MIN_RATIO if kind != BOARD else MIN_BOARD_RATIO
        if share[top].sum() >= MIN_CONSISTENT_SHARE and share[top].sum() >= ratio * expected[top].sum():
            return kind, [(int(k), float(share[k])) for k in top]
    return HAND, []


def _list_largest(values: FloatArray, group: NDArray[np.intp], least: float) -> list[tuple[int, float]]:
    """Return up to six groups with a share of at least `least` in the sum of positive values, largest share first.

    The result contains pairs of group number and share. values: f64[n] (n taxels). group: [n], number of the group of
    each taxel.
    """
    share = _compute_shares(np.bincount(group, values).astype(np.float64))
    order = np.argsort(-share, kind="stable")[:6]
    return [(int(k), float(share[k])) for k in order if share[k] >= least]


def _compute_shares(values: FloatArray) -> FloatArray:
    """Return the shares of the positive values in their sum; negative values have the share 0."""
    positive = np.maximum(values, 0.0)
    return np.asarray(positive / max(float(positive.sum()), 1e-30))


def make_location_entry(pair: Pair, scope: str, number: int, share: float) -> dict[str, Any]:
    """Return a location as an entry of the report: index of a taxel, address of a board, or board, axis and line.

    scope: kind of location. number: number of the location as in `get_groups`. share: share of the remainder.
    """
    if scope == TAXEL:
        return {"index": number, "share": share}
    first = int(np.flatnonzero(get_groups(pair, scope) == number)[0])
    address = int(pair.taxels.sensor[first])
    if scope == BOARD:
        return {"address": address, "name": pair.sensors.name[int(pair.groups.sensor[first])], "share": share}
    axis, lines = ("tx", pair.taxels.tx) if scope == ROW else ("rx", pair.taxels.rx)
    return {"address": address, "axis": axis, "index": int(lines[first]), "share": share}


def describe_location(pair: Pair, scope: str, number: int) -> str:
    """Return a location as words of a sentence, such as "TX line 3 of index tip".

    scope: kind of location. number: number of the location as in `get_groups`.
    """
    first = int(np.flatnonzero(get_groups(pair, scope) == number)[0])
    board = pair.sensors.name[int(pair.groups.sensor[first])].replace("_", " ")
    tx, rx = int(pair.taxels.tx[first]), int(pair.taxels.rx[first])
    return {
        BOARD: board,
        ROW: f"TX line {tx} of {board}",
        COLUMN: f"RX line {rx} of {board}",
        TAXEL: f"taxel TX {tx}, RX {rx} of {board}",
    }[scope]
