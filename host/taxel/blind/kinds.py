"""Causes of the catalogue that a world may hide: the emulator's words, with parameters drawn by a strength of 0 to 1.

Ranges are chosen so that the gap lies from half a floor to six floors above it (`tools/blind/strengths.py` measures
them); noise and drift that are others in every session raise the floor as well, and cannot come so far. What a world's
gap came out as is measured, and the score tells accuracy against it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from taxel.blind.form import Form, Rng, address_word, around, between, simple, some_boards, taxels_of
from taxel.blind.hidden import Cause, Place
from taxel.hand import Hand

ALL_ROUND: Final = 0.7935
"""Of its length along the lines, the distance at which a kernel exp(-(|x| + |y|) / length) has fallen to 1/e, mean over
all directions: the mean of 1 / (|cos| + |sin|)."""


SILENT: Final = "silent from"
"""The emulator's word for a board that answers nothing from some second on; here from the beginning."""


def _film(size: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"length_m={1e-3 * size:.6f}", {"spread_mm": ALL_ROUND * size}


def _resistive(ohm: float, rng: Rng) -> tuple[str, dict[str, float]]:
    tx, rx = (ohm * around(rng, 0.6, 1.6) for _ in range(2))
    return f"tx_ohm={tx:.0f} rx_ohm={rx:.0f}", {}


def _traces(picofarad: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"picofarad={picofarad} tx_ohm={around(rng, 600, 1500):.0f} rx_ohm={around(rng, 600, 1500):.0f}", {}


MOST_CURRENT: Final = 1.35
"""Of a board's source: with more its counter has no range left for a signal, and reads 0."""


def _board_factor(name: str, form: str, most: float = np.inf) -> Form:
    """One or two boards differ by a factor; strength 1 is a factor of 1.8 either way, of `most` at most."""

    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        lines, truth = [], {}
        for board in some_boards(rng, hand, 2):
            log = between(0.045, 0.6, strength) * float(rng.choice([-1.0, 1.0]))
            factor = round(min(float(np.exp(log)), most), 4)
            lines.append(f"{form} factor={factor} {address_word(board)}")
            if name == "gain_mismatch":
                truth[f"scale@{board.address}"] = factor
        return Cause(name, form, tuple(lines), (), truth)

    return Form(name, form, draw)


def _dead(form: str) -> Form:
    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        (board,) = some_boards(rng, hand)
        taxels = taxels_of(hand, board)
        count = max(2, round(between(3, 0.4 * len(taxels), strength)))
        first = int(rng.choice(len(taxels)))  # neighbours, as where a corner of the layer is off
        places = np.array([hand.position[taxel] for taxel in taxels])
        near = np.argsort(np.linalg.norm(places - places[first], axis=1))[:count].tolist()
        value = int(rng.integers(20000, 45000))
        rest = "" if form == "rest" else f" value={value}"
        lines = tuple(f"dead {form} {address_word(board)} taxel={own}{rest}" for own in sorted(near))
        where = tuple(Place(board.address, "taxel", taxels[own]) for own in sorted(near))
        return Cause("dropout", f"dead {form}", lines, where)

    return Form("dropout", f"dead {form}", draw)


def _broken(form: str) -> Form:
    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        (board,) = some_boards(rng, hand)
        axis = int(rng.integers(2))
        count = (board.kind.tx_count, board.kind.rx_count)[axis]
        index = int(rng.integers(count - (form == "short")))
        line = f"line {form} {address_word(board)} axis={axis} index={index}"
        word = ("tx", "rx")[axis]
        where = [Place(board.address, word, index)]
        if form == "short":
            where.append(Place(board.address, word, index + 1))
        return Cause("dropout", f"line {form}", (line,), tuple(where))

    return Form("dropout", f"line {form}", draw)


def _silent(rng: Rng, hand: Hand, strength: float) -> Cause:
    (board,) = some_boards(rng, hand)
    return Cause("dropout", SILENT, (f"{SILENT} {address_word(board)} seconds=0",), (Place(board.address),))


def _flaky(rng: Rng, hand: Hand, strength: float) -> Cause:
    (board,) = some_boards(rng, hand)
    line = f"silent flaky p={between(0.08, 0.7, strength)} {address_word(board)}"
    return Cause("dropout", "silent flaky", (line,), (Place(board.address),))


def _unit(rng: Rng) -> np.ndarray:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def _offset(word: str, least: float, most: float) -> Form:
    """A bracket or an object stands elsewhere; strength 1 is `most` mm and half as many degrees again."""

    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        size = between(least, most, strength)
        move, turn = 1e-3 * size * _unit(rng), np.radians(1.5 * size) * _unit(rng)
        numbers = " ".join(f"{value:.5f}" for value in (*move, *turn))
        if word == "bracket_offset":
            (board,) = some_boards(rng, hand)
            return Cause("pose_error", word, (f"{word} {board.name} {numbers}",), (Place(board.address),))
        return Cause("pose_error", word, (f"{word} OBJECT {numbers}",))

    return Form("pose_error", word, draw)


def _late(form: str) -> Form:
    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        lines, truth = [], {}
        for board in some_boards(rng, hand, 2):
            seconds = between(0.04, 0.42, strength)
            lines.append(f"late {form} seconds={seconds} {address_word(board)}")
            truth[f"seconds@{board.address}"] = seconds
        return Cause("latency", f"late {form}", tuple(lines), (), truth if form == "delay" else {})

    return Form("latency", f"late {form}", draw)


def _noise_line(counts: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"counts={counts} axis={int(rng.integers(3))}", {"common_counts": counts}


def _play(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    width, creep, seconds = around(rng, 1e-4, 4e-4), around(rng, 0.05, 0.25), around(rng, 0.4, 3.0)
    return f"fraction={fraction} width_m={width} creep={creep} seconds={seconds}", {}


def _solid(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    seconds = around(rng, 0.3, 2.0)
    return f"fraction={fraction} seconds={seconds}", {"seconds": seconds}


def _counts(name: str) -> Callable[[float, Rng], tuple[str, dict[str, float]]]:
    return lambda size, rng: (f"counts={size}", {name: size})


def _drifting(low: float, high: float) -> Callable[[float, Rng], tuple[str, dict[str, float]]]:
    """Within some `low` to `high` seconds."""
    return lambda size, rng: (f"counts={size} seconds={around(rng, low, high)}", {})


def _proximity(share: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"share={share} reach_m={around(rng, 0.001, 0.004)}", {}


INSIDE: Final = (
    simple("contact_propagation", "spread film", 0.35, 2.0, _film),
    simple("contact_propagation", "spread pillars", 0.28, 0.12, lambda slope, rng: (f"slope={slope}", {})),
    simple("electrode_crosstalk", "coupling resistive", 450, 1700, _resistive),
    simple("electrode_crosstalk", "coupling traces", 3.0, 25.0, _traces),
    simple("noise", "noise white", 12, 200, _counts("white_counts")),
    simple("noise", "noise line", 8, 180, _noise_line),
    simple("noise", "noise pink", 40, 400, lambda size, rng: (f"counts={size} shared={int(rng.integers(2))}", {})),
    simple("gain_mismatch", "gain electrode", 0.02, 0.35, lambda std, rng: (f"log_std={std}", {"log_std": std})),
    _board_factor("gain_mismatch", "gain idac", MOST_CURRENT),
    _board_factor("stiffness", "modulus board"),
    simple("stiffness", "modulus taxels", 0.04, 0.42, lambda std, rng: (f"log_std={std}", {})),
    simple("baseline_drift", "drift warm_up", 100, 2500, _drifting(60, 400)),
    simple("baseline_drift", "drift wander", 100, 1000, _drifting(20, 120)),
    simple("hysteresis", "rheology solid", 0.05, 0.5, _solid),
    simple("hysteresis", "rheology play", 0.1, 0.6, _play),
    simple("saturation", "saturation clip", 1300, 600, _counts("counts")),
    simple("saturation", "saturation soft", 15000, 2500, _counts("counts")),
    simple("proximity", "proximity image", 0.005, 0.065, _proximity),
    simple("proximity", "proximity wedge", 0.005, 0.065, _proximity),
    _dead("rest"),
    _dead("stuck"),
    _broken("open"),
    _broken("short"),
    Form("dropout", SILENT, _silent),
    Form("dropout", "silent flaky", _flaky),
    _offset("bracket_offset", 0.3, 2.5),
    _offset("object_offset", 0.25, 1.5),
    _late("delay"),
    _late("lag"),
)  # fmt: skip
"""Causes of the catalogue."""

NAMES: Final = tuple(dict.fromkeys(form.name for form in INSIDE))
"""The catalogue's names that worlds hide."""


def forms_of(name: str) -> tuple[Form, ...]:
    """Of a catalogue name."""
    return tuple(form for form in INSIDE if form.name == name)


def nuisances(rng: Rng) -> tuple[str, ...]:
    """Small departures that every skin has: gains within a part's tolerance, a room whose temperature changes."""
    return (
        f"gain electrode log_std={rng.uniform(0.005, 0.02):.4f}",
        f"drift wander counts={rng.uniform(0.5, 2.0):.3f} seconds={rng.uniform(40, 120):.0f}",
    )
