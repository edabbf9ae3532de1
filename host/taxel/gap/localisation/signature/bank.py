"""What the best set of effects leaves, against a bank of generic distortions: what it looks like, and where."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.pair import Pair
from taxel.gap.features.features import Layout, SessionMeans
from taxel.gap.features.metric import off_diagonal
from taxel.gap.localisation.signature.contacts import Change, changes
from taxel.gap.localisation.signature.fit import Remainder, Told, p_value, told
from taxel.gap.localisation.signature.places import Spot, energy, located, place_entry, spots
from taxel.gap.localisation.signature.shapes import BOARD, COLUMN, HAND, ROW, TAXEL, shapes
from taxel.gap.localisation.signature.words import change_words, shape_words, sum_words
from taxel.gap.localisation.where import PHASES, Products, p_values, products, shares, summed
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

LEVEL: Final = 0.05
"""Of a p-value, corrected over the bank, under which a distortion is said to be there."""

LEAST_SHARE: Final = 0.15
"""Of what is left, that a distortion must tell to be what it looks like."""

PERHAPS: Final = 0.3
"""The same where too few sessions leave it untested, or nearly so."""

NEARLY: Final = 0.25
"""A p-value above this one is no reason even for "perhaps"."""

ALMOST: Final = 0.85
"""Of the largest share: a distortion of fewer numbers that tells this much is preferred."""

FIXED: Final = {BOARD: "board", ROW: "row", COLUMN: "column", TAXEL: "taxel"}


@dataclass(frozen=True, eq=False)
class Entry:
    """A distortion of the bank. share: of what is left; counts2: that share in counts^2. size: how many numbers it has.
    Of where it comes from one is given: fitted columns, places that stand out, or a change over sessions or presses.
    """

    name: str
    scope: str
    share: float
    counts2: float
    p_value: float | None
    size: int
    told: Told | None = None
    spot: Spot | None = None
    change: Change | None = None


@dataclass(frozen=True, eq=False)
class Signature:
    """bank: the best entry of each distortion, largest share first. best: what it looks like; None: like none of them.
    sure: whether it was tested. besides: changes over sessions and presses that stand beside the excess.
    """

    left: Remainder
    excess: float
    pressed: FloatArray
    bank: tuple[Entry, ...]
    best: Entry | None
    sure: bool
    besides: tuple[Entry, ...]


def unexplained(
    pair: Pair, layout: Layout, real: SessionMeans, model: FloatArray, fold: NDArray[np.intp], seed: int
) -> dict[str, Any]:
    """The report's `unexplained`.

    model: f64[C, F, n], with the best set; NaN where unknown. fold: [C], parts of the cells that are left out in turn.
    """
    real = replace(real, value=np.where(np.isfinite(model)[:, None], real.value, np.nan))
    model = np.nan_to_num(model)
    left = products(real, model, layout)
    count = len(pair.sensors.address)
    gram = summed(left.taxels, pair.groups.sensor, count)
    p = p_values(gram, summed(left.centred_taxels, pair.groups.sensor, count), seed)
    excess = off_diagonal(gram)
    found = signature(pair, layout, real, model, fold)
    boards = [int(k) for k in np.argsort(-excess, kind="stable") if p[k] < LEVEL]
    share = shares(excess)
    where = [
        {**place_entry(pair, BOARD, k, float(share[k])), "p_value": float(p[k])}
        for k in boards
        if (pair.groups.sensor == k).any()
    ]
    words = ""
    if boards:
        words, places = _said(pair, layout, found, model)
        where = places or where
        if found.best is None:
            words = f"{words}; mostly in {_phase(left, layout)} and on {_name(pair, boards[0])}"
    words = sum_words([words, *(change_words(pair, one.change) for one in found.besides if one.change is not None)])
    return {
        "p_value": float(p.min(initial=1.0)),
        "signature": words,
        "where": where,
        "bank": [
            {"name": one.name, "scope": one.scope, "share": one.share, "counts2": one.counts2, "p_value": one.p_value}
            for one in found.bank
        ],
    }


def signature(pair: Pair, layout: Layout, real: SessionMeans, model: FloatArray, fold: NDArray[np.intp]) -> Signature:
    """Try the bank. See `unexplained`."""
    left = Remainder.of(pair, real, model, layout, fold)
    excess = float(off_diagonal(left.gram))
    pressed = energy(left, model, layout.bins)
    entries = [_of_told(one, excess) for shape in shapes(pair, layout, model) for one in told(left, shape)]
    entries += [_of_spot(one, excess) for one in spots(left, model, layout.bins)]
    counts2 = float(np.nansum((model[:, : layout.bins] * left.root[: layout.bins]) ** 2))
    hold = model[:, pair.clock.bins_of(Phase.HOLD)[0]]
    steps = [_of_change(one, excess) for one in changes(pair, hold, counts2)]
    tested = _corrected([*entries, *steps])
    entries, steps = tested[: len(entries)], tested[len(entries) :]
    best_of = [
        _simplest([one for one in entries if one.name == name]) for name in dict.fromkeys(e.name for e in entries)
    ]
    best, sure = _best(entries) if excess > 0 else (None, True)
    besides = tuple(
        one for one in steps if one.share >= LEAST_SHARE and one.p_value is not None and one.p_value < LEVEL
    )
    bank = sorted([*best_of, *steps], key=lambda one: -one.share)
    return Signature(left, excess, pressed.sum(axis=0), tuple(bank), best, sure, besides)


def _of_told(one: Told, excess: float) -> Entry:
    share = _share(off_diagonal(one.total), excess)
    return Entry(one.shape, one.scope, share, share * excess, p_value(one.total), one.size, told=one)


def _of_spot(one: Spot, excess: float) -> Entry:
    share = _share(off_diagonal(one.gram), excess)
    size = 2 * len(one.numbers) + (one.scope == TAXEL)
    return Entry(FIXED[one.scope], one.scope, share, share * excess, one.p_value, size, spot=one)


def _share(part: FloatArray, excess: float) -> float:
    return float(np.clip(float(part) / excess, 0.0, 1.0)) if excess > 0 else 0.0


def _of_change(one: Change, excess: float) -> Entry:
    whole = one.part + max(excess, 0.0)
    scope = HAND if not one.boards else BOARD
    return Entry(one.name, scope, one.part / whole if whole > 0 else 0.0, one.part, one.p_value, 1, change=one)


def _corrected(entries: list[Entry]) -> list[Entry]:
    """P-values corrected for all that were tried, step down (Holm 1979)."""
    tested = sorted((one.p_value, k) for k, one in enumerate(entries) if one.p_value is not None)
    result, least = list(entries), 0.0
    for rank, (p, k) in enumerate(tested):
        least = max(least, min(1.0, p * (len(tested) - rank)))
        result[k] = replace(entries[k], p_value=least)
    return result


def _simplest(entries: list[Entry]) -> Entry:
    """The one of fewest numbers among those that tell almost as much as the best; those that are there first."""
    there = [one for one in entries if _is_there(one)] or entries
    most = max(one.share for one in there)
    return min((one for one in there if one.share >= ALMOST * most), key=lambda one: one.size)


def _best(entries: list[Entry]) -> tuple[Entry | None, bool]:
    """What it looks like: a place that stands out only where no form tells half of what lies there."""
    for sure, least in ((True, LEAST_SHARE), (False, PERHAPS)):
        there = [one for one in entries if one.share >= least and (_is_there(one) if sure else _may_be(one))]
        forms = [one for one in there if one.spot is None]
        most = max((one.share for one in there), default=0.0)
        if any(one.share >= 0.5 * most for one in forms):
            return _simplest(forms), sure
        if there:
            return _simplest([one for one in there if one.spot is not None]), sure
    return None, True


def _is_there(one: Entry) -> bool:
    return one.p_value is not None and one.p_value < LEVEL


def _may_be(one: Entry) -> bool:
    return one.p_value is None or one.p_value < NEARLY


def _said(pair: Pair, layout: Layout, found: Signature, model: FloatArray) -> tuple[str, list[dict[str, Any]]]:
    """The sentence, and the places."""
    best = found.best
    if best is None:
        largest = max((one.share for one in found.bank if one.change is None), default=0.0)
        return (
            f"not significantly similar to a generic distortion; the best one explains {100 * largest:.0f} % of it",
            [],
        )
    if best.spot is not None:
        taxels, scope = best.spot.taxels, best.spot.scope
        whole = max(float(taxels.sum()), 1e-30)
        group = {BOARD: pair.groups.sensor, ROW: pair.groups.tx, COLUMN: pair.groups.rx}.get(scope, np.arange(pair.n))
        places = [(k, float(taxels[group == k].sum()) / whole) for k in best.spot.numbers]
    else:
        assert best.told is not None
        scope, places = located(pair, best.told.taxels, found.pressed, best.told.scope)
    words = shape_words(pair, layout, best.told, best.spot, model, scope, [k for k, _ in places])
    sure = "" if found.sure else "possibly "
    words = f"{sure}{words}; {100 * best.share:.0f} % of the unexplained part"
    return words, [place_entry(pair, scope, k, share * best.share) for k, share in places]


def _phase(left: Products, layout: Layout) -> str:
    flat = off_diagonal(left.conditions).sum(axis=0)
    phases = [phase for phase in PHASES if (layout.phase == phase).any()]
    return PHASES[max(phases, key=lambda phase: float(flat[layout.phase == phase].sum()))]


def _name(pair: Pair, board: int) -> str:
    return pair.sensors.name[board].replace("_", " ")
