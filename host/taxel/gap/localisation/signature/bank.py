"""Comparison of the remainder with a bank of generic distortions: the most similar distortion and its location."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.pair import Pair
from taxel.gap.features.features import FeatureLayout, SessionMeans
from taxel.gap.features.metric import compute_off_diagonal_mean
from taxel.gap.localisation.signature.distortions import BOARD, COLUMN, HAND, ROW, TAXEL, generate_distortions
from taxel.gap.localisation.signature.fit import DistortionFit, Remainder, compute_p_value, fit_distortion
from taxel.gap.localisation.signature.locations import (
    LocalDeviation,
    compute_signal_energy,
    find_local_deviations,
    locate_explained_part,
    make_location_entry,
)
from taxel.gap.localisation.signature.sensitivity import (
    SIGNIFICANCE_LEVEL,
    SensitivityChange,
    compute_sensitivity_changes,
)
from taxel.gap.localisation.signature.sentences import describe_change, describe_distortion, join_clauses
from taxel.gap.localisation.where import (
    PHASES,
    ResidualProducts,
    compute_p_values,
    compute_products,
    compute_shares,
    sum_groups,
)
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

MIN_SHARE: Final = 0.15
"""Smallest share of the remainder that a significant distortion explains if the sentence names it. Chosen."""

MIN_TENTATIVE_SHARE: Final = 0.3
"""Smallest share like `MIN_SHARE` for a sentence with "possibly", whose distortion is not significant. Chosen larger,
because too few sessions leave the distortion untested or hardly tested."""

MAX_TENTATIVE_P_VALUE: Final = 0.25
"""Corrected p-value from which a distortion is not named, not even with "possibly". Chosen."""

NEARLY_BEST: Final = 0.85
"""Part of the largest explained share from which a distortion with fewer coefficients is preferred. Chosen."""

LOCAL_NAMES: Final = {BOARD: "board", ROW: "row", COLUMN: "column", TAXEL: "taxel"}
"""Name in the report of a local deviation, by kind of location; the distortions of single locations have these names,
too."""


@dataclass(frozen=True, eq=False)
class BankEntry:
    """A distortion of the bank with its result.

    name: name in the report. scope: kind of location whose taxels share coefficients, such as "hand" or "row" (a TX
    line). share: explained share of the remainder. counts2: explained part of the squared gap, counts^2. p_value: None
    below 3 sessions; corrected for the number of tests in the results of `compute_signature`. coefficient_count: number
    of coefficients, by which the simplest distortion is selected. Exactly one of these fields is set: fit: fitted
    columns; local: conspicuous locations; change: a change of sensitivity.
    """

    name: str
    scope: str
    share: float
    counts2: float
    p_value: float | None
    coefficient_count: int
    fit: DistortionFit | None = None
    local: LocalDeviation | None = None
    change: SensitivityChange | None = None


@dataclass(frozen=True, eq=False)
class Signature:
    """Result of the comparison of the remainder with the bank.

    remainder: residuals that were compared. excess: excess of the remainder, counts^2. signal_energy: f64[n] (n
    taxels), weighted squared signals of each taxel, counts^2. bank: best entry of each distortion, and the changes of
    sensitivity, largest share first. best: most similar distortion; None if no distortion meets the limits. is_certain:
    False if `best` only meets the limits of a sentence with "possibly". significant_changes: significant changes of
    sensitivity, which are not a part of the excess.
    """

    remainder: Remainder
    excess: float
    signal_energy: FloatArray
    bank: tuple[BankEntry, ...]
    best: BankEntry | None
    is_certain: bool
    significant_changes: tuple[BankEntry, ...]


def describe_unexplained(
    pair: Pair, layout: FeatureLayout, real: SessionMeans, model: FloatArray, fold: NDArray[np.intp], seed: int
) -> dict[str, Any]:
    """Return the report field `unexplained`: a description of the remainder (real minus predicted features).

    The field contains the p-value of the remainder, a sentence on the most similar generic distortion, locations, and
    the results of all distortions (`bank`). The sentence and the locations are empty if the remainder is not
    significant on any board and no change of sensitivity is significant.

    model: f64[C, F, n] (C conditions, F features, n taxels), features that the best set of effects predicts, counts;
    NaN where unknown. fold: [C], fold of each condition; the conditions of a fold are predicted by a fit to the other
    conditions. seed: seed of the random numbers of the p-values.
    """
    real = replace(real, value=np.where(np.isfinite(model)[:, None], real.value, np.nan))
    model = np.nan_to_num(model)
    products = compute_products(real, model, layout)
    count = len(pair.sensors.address)
    gram = sum_groups(products.taxels, pair.groups.sensor, count)
    p = compute_p_values(gram, sum_groups(products.centred_taxels, pair.groups.sensor, count), seed)
    excess = compute_off_diagonal_mean(gram)
    signature = compute_signature(pair, layout, real, model, fold)
    boards = [int(k) for k in np.argsort(-excess, kind="stable") if p[k] < SIGNIFICANCE_LEVEL]
    share = compute_shares(excess)
    where = [
        {**make_location_entry(pair, BOARD, k, float(share[k])), "p_value": float(p[k])}
        for k in boards
        if (pair.groups.sensor == k).any()
    ]
    clause = ""
    if boards:
        clause, locations = _describe_best(pair, layout, signature, model)
        where = locations or where
        if signature.best is None:
            clause = f"{clause}; mostly in {_name_main_phase(products, layout)} and on {_name_board(pair, boards[0])}"
    changes = [entry.change for entry in signature.significant_changes if entry.change is not None]
    return {
        "p_value": float(p.min(initial=1.0)),
        "signature": join_clauses([clause, *(describe_change(pair, change) for change in changes)]),
        "where": where,
        "bank": [
            {"name": one.name, "scope": one.scope, "share": one.share, "counts2": one.counts2, "p_value": one.p_value}
            for one in signature.bank
        ],
    }


def compute_signature(
    pair: Pair, layout: FeatureLayout, real: SessionMeans, model: FloatArray, fold: NDArray[np.intp]
) -> Signature:
    """Compare the remainder (real minus predicted features) with all generic distortions of the bank.

    real: mean features of the real sessions. model: f64[C, F, n] (C conditions, F features, n taxels), predicted
    features, counts. fold: [C], cross-validation fold of each condition.
    """
    remainder = Remainder.compute(pair, real, model, layout, fold)
    excess = float(compute_off_diagonal_mean(remainder.gram))
    energy = compute_signal_energy(remainder, model, layout.bins)
    entries = [
        _make_fit_entry(fit, excess)
        for distortion in generate_distortions(pair, layout, model)
        for fit in fit_distortion(remainder, distortion)
    ]
    entries += [_make_local_entry(local, excess) for local in find_local_deviations(remainder, model, layout.bins)]
    counts2 = float(np.nansum((model[:, : layout.bins] * remainder.root_weight[: layout.bins]) ** 2))
    hold = model[:, pair.time_grid.find_bins(Phase.HOLD)[0]]
    changes = [_make_change_entry(change, excess) for change in compute_sensitivity_changes(pair, hold, counts2)]
    corrected = _correct_p_values([*entries, *changes])
    entries, changes = corrected[: len(entries)], corrected[len(entries) :]
    best_of_each = [
        _select_simplest([one for one in entries if one.name == name])
        for name in dict.fromkeys(e.name for e in entries)
    ]
    best, is_certain = _select_best(entries) if excess > 0 else (None, True)
    significant_changes = tuple(one for one in changes if one.share >= MIN_SHARE and _is_significant(one))
    bank = sorted([*best_of_each, *changes], key=lambda one: -one.share)
    return Signature(remainder, excess, energy.sum(axis=0), tuple(bank), best, is_certain, significant_changes)


def _make_fit_entry(fit: DistortionFit, excess: float) -> BankEntry:
    """Return the bank entry of a fitted distortion. excess: excess of the remainder, counts^2."""
    share = _compute_share(compute_off_diagonal_mean(fit.explained), excess)
    p_value = compute_p_value(fit.explained)
    return BankEntry(fit.name, fit.scope, share, share * excess, p_value, fit.coefficient_count, fit=fit)


def _make_local_entry(local: LocalDeviation, excess: float) -> BankEntry:
    """Return the bank entry of a local deviation. excess: excess of the remainder, counts^2."""
    share = _compute_share(compute_off_diagonal_mean(local.gram), excess)
    # Number of coefficients: a factor and an offset for each location. Taxels count one more, so that the selection of
    # the simplest entry prefers an equal number of lines or boards.
    count = 2 * len(local.groups) + (local.scope == TAXEL)
    return BankEntry(LOCAL_NAMES[local.scope], local.scope, share, share * excess, local.p_value, count, local=local)


def _compute_share(explained: FloatArray, excess: float) -> float:
    return float(np.clip(float(explained) / excess, 0.0, 1.0)) if excess > 0 else 0.0


def _make_change_entry(change: SensitivityChange, excess: float) -> BankEntry:
    """Return the bank entry of a change of sensitivity. excess: excess of the remainder, counts^2.

    Its share refers to the sum of the excess and of the change's own contribution to the squared gap.
    """
    whole = change.added_gap2 + max(excess, 0.0)  # a change is not a part of the excess
    scope = HAND if not change.boards else BOARD
    share = change.added_gap2 / whole if whole > 0 else 0.0
    return BankEntry(change.name, scope, share, change.added_gap2, change.p_value, 1, change=change)


def _correct_p_values(entries: list[BankEntry]) -> list[BankEntry]:
    """Return the entries, in the same order, with p-values corrected for the number of tests (step-down method, Holm
    1979). Entries without p-value are returned unchanged and not counted as tests.
    """
    tested = sorted((one.p_value, k) for k, one in enumerate(entries) if one.p_value is not None)
    result, least = list(entries), 0.0
    for rank, (p, k) in enumerate(tested):
        least = max(least, min(1.0, p * (len(tested) - rank)))
        result[k] = replace(entries[k], p_value=least)
    return result


def _select_simplest(entries: list[BankEntry]) -> BankEntry:
    """Return the entry with the fewest coefficients among those that explain at least `NEARLY_BEST` of the largest
    share.

    Only significant entries are considered, or all entries if none is significant.
    """
    considered = [one for one in entries if _is_significant(one)] or entries
    largest = max(one.share for one in considered)
    return min((one for one in considered if one.share >= NEARLY_BEST * largest), key=lambda one: one.coefficient_count)


def _select_best(entries: list[BankEntry]) -> tuple[BankEntry | None, bool]:
    """Return the distortion that the sentence names, and whether the sentence states it without "possibly".

    First, only significant entries with a share of at least `MIN_SHARE` are considered; the sentence then states the
    result without "possibly". If there are none, entries that are not clearly insignificant (`_is_possible`) and have a
    share of at least `MIN_TENTATIVE_SHARE` are considered. If there are again none, the result is (None, True).

    Of the considered entries, the simplest one that explains nearly as much as the best one is returned
    (`_select_simplest`). A local deviation is returned only if no fitted distortion explains half of the largest share.
    """
    for is_certain, least in ((True, MIN_SHARE), (False, MIN_TENTATIVE_SHARE)):
        meets_limit = _is_significant if is_certain else _is_possible
        considered = [one for one in entries if one.share >= least and meets_limit(one)]
        fitted = [one for one in considered if one.local is None]
        largest = max((one.share for one in considered), default=0.0)
        if any(one.share >= 0.5 * largest for one in fitted):
            return _select_simplest(fitted), is_certain
        if considered:
            return _select_simplest([one for one in considered if one.local is not None]), is_certain
    return None, True


def _is_significant(entry: BankEntry) -> bool:
    return entry.p_value is not None and entry.p_value < SIGNIFICANCE_LEVEL


def _is_possible(entry: BankEntry) -> bool:
    return entry.p_value is None or entry.p_value < MAX_TENTATIVE_P_VALUE


def _describe_best(
    pair: Pair, layout: FeatureLayout, signature: Signature, model: FloatArray
) -> tuple[str, list[dict[str, Any]]]:
    """Return the clause that describes the most similar distortion, and its locations as entries of the report.

    Without a similar distortion the clause states the largest explained share, and the list is empty.
    """
    best = signature.best
    if best is None:
        largest = max((one.share for one in signature.bank if one.change is None), default=0.0)
        return (
            f"not significantly similar to a generic distortion; the best one explains {100 * largest:.0f} % of it",
            [],
        )
    if best.local is not None:
        excess_by_taxel, scope = best.local.excess_by_taxel, best.local.scope
        whole = max(float(excess_by_taxel.sum()), 1e-30)
        group = {BOARD: pair.groups.sensor, ROW: pair.groups.tx, COLUMN: pair.groups.rx}.get(scope, np.arange(pair.n))
        locations = [(k, float(excess_by_taxel[group == k].sum()) / whole) for k in best.local.groups]
    else:
        assert best.fit is not None
        scope, locations = locate_explained_part(
            pair, best.fit.explained_by_taxel, signature.signal_energy, best.fit.scope
        )
    clause = describe_distortion(pair, layout, best.fit, best.local, model, scope, [k for k, _ in locations])
    qualifier = "" if signature.is_certain else "possibly "
    clause = f"{qualifier}{clause}; {100 * best.share:.0f} % of the unexplained part"
    return clause, [make_location_entry(pair, scope, k, share * best.share) for k, share in locations]


def _name_main_phase(products: ResidualProducts, layout: FeatureLayout) -> str:
    """Return the name of the phase of a grasp, such as "hold", that contains the largest part of the excess."""
    excess = compute_off_diagonal_mean(products.conditions).sum(axis=0)
    phases = [phase for phase in PHASES if (layout.phase == phase).any()]
    return PHASES[max(phases, key=lambda phase: float(excess[layout.phase == phase].sum()))]


def _name_board(pair: Pair, board: int) -> str:
    return pair.sensors.name[board].replace("_", " ")
