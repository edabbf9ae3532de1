"""Every cause that a world may hide: the emulator's words, with parameters drawn by a strength between 0 and 1.

Ranges are chosen so that the gap lies from half a floor to six floors above it (`tools/blind/strengths.py` measures
them); noise and drift that are others in every session raise the floor as well, and cannot come so far. What a world's
gap came out as is measured, and the score tells accuracy against it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.blind.hidden import UNKNOWN, Cause, Place
from taxel.hand import Hand
from taxel.hand.description import Board

Rng = np.random.Generator
Draw = Callable[[Rng, Hand, float], Cause]


@dataclass(frozen=True)
class Form:
    """A cause in one of the emulator's forms. draw: with a strength from 0 to 1."""

    name: str
    form: str
    draw: Draw


def _between(low: float, high: float, strength: float) -> float:
    """On a logarithmic scale."""
    return float(f"{low * (high / low) ** strength:.4g}")


def _around(rng: Rng, low: float, high: float) -> float:
    return _between(low, high, float(rng.random()))


def _address(board: Board) -> str:
    return f"board=0x{board.address:02X}"


def _front(hand: Hand) -> list[Board]:
    """Boards that presses reach."""
    return [board for board in hand.boards if "back" not in board.kind.name]


def _some(rng: Rng, hand: Hand, most: int = 1) -> list[Board]:
    boards = _front(hand)
    count = int(rng.integers(1, min(most, len(boards)) + 1))
    return [boards[index] for index in sorted(rng.choice(len(boards), count, replace=False).tolist())]


def _taxels(hand: Hand, board: Board) -> list[int]:
    return np.flatnonzero(hand.board_index == hand.boards.index(board)).tolist()


def _simple(
    name: str, form: str, low: float, high: float, words: Callable[[float, Rng], tuple[str, dict[str, float]]]
) -> Form:
    """A cause of the whole hand with one main parameter. words: the rest of the line, and the truth."""

    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        line, truth = words(_between(low, high, strength), rng)
        return Cause(name, form, (f"{form} {line}",), (), truth)

    return Form(name, form, draw)


ALL_ROUND: Final = 0.7935
"""Of its length along the lines, the distance at which a kernel exp(-(|x| + |y|) / length) has fallen to 1/e, mean over
all directions: the mean of 1 / (|cos| + |sin|)."""


def _film(size: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"length_m={1e-3 * size:.6f}", {"spread_mm": ALL_ROUND * size}


def _resistive(ohm: float, rng: Rng) -> tuple[str, dict[str, float]]:
    tx, rx = (ohm * _around(rng, 0.6, 1.6) for _ in range(2))
    return f"tx_ohm={tx:.0f} rx_ohm={rx:.0f}", {}


def _traces(picofarad: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"picofarad={picofarad} tx_ohm={_around(rng, 600, 1500):.0f} rx_ohm={_around(rng, 600, 1500):.0f}", {}


def _board_factor(name: str, form: str) -> Form:
    """One or two boards differ by a factor; strength 1 is a factor of 1.8 either way."""

    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        lines, truth = [], {}
        for board in _some(rng, hand, 2):
            log = _between(0.045, 0.6, strength) * float(rng.choice([-1.0, 1.0]))
            factor = round(float(np.exp(log)), 4)
            lines.append(f"{form} factor={factor} {_address(board)}")
            if name == "gain_mismatch":
                truth[f"scale@{board.address}"] = factor
        return Cause(name, form, tuple(lines), (), truth)

    return Form(name, form, draw)


def _dead(form: str) -> Form:
    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        (board,) = _some(rng, hand)
        taxels = _taxels(hand, board)
        count = max(2, round(_between(3, 0.4 * len(taxels), strength)))
        first = int(rng.choice(len(taxels)))  # neighbours, as where a corner of the layer is off
        places = np.array([hand.position[taxel] for taxel in taxels])
        near = np.argsort(np.linalg.norm(places - places[first], axis=1))[:count].tolist()
        value = int(rng.integers(20000, 45000))
        rest = "" if form == "rest" else f" value={value}"
        lines = tuple(f"dead {form} {_address(board)} taxel={own}{rest}" for own in sorted(near))
        where = tuple(Place(board.address, "taxel", taxels[own]) for own in sorted(near))
        return Cause("dropout", f"dead {form}", lines, where)

    return Form("dropout", f"dead {form}", draw)


def _broken(form: str) -> Form:
    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        (board,) = _some(rng, hand)
        axis = int(rng.integers(2))
        count = (board.kind.tx_count, board.kind.rx_count)[axis]
        index = int(rng.integers(count - (form == "short")))
        line = f"line {form} {_address(board)} axis={axis} index={index}"
        word = ("tx", "rx")[axis]
        where = [Place(board.address, word, index)]
        if form == "short":
            where.append(Place(board.address, word, index + 1))
        return Cause("dropout", f"line {form}", (line,), tuple(where))

    return Form("dropout", f"line {form}", draw)


def _silent(rng: Rng, hand: Hand, strength: float) -> Cause:
    (board,) = _some(rng, hand)
    return Cause("dropout", "silent from", (f"silent from {_address(board)} seconds=0",), (Place(board.address),))


def _flaky(rng: Rng, hand: Hand, strength: float) -> Cause:
    (board,) = _some(rng, hand)
    line = f"silent flaky p={_between(0.08, 0.7, strength)} {_address(board)}"
    return Cause("dropout", "silent flaky", (line,), (Place(board.address),))


def _unit(rng: Rng) -> np.ndarray:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def _offset(word: str, least: float, most: float) -> Form:
    """A bracket or an object stands elsewhere; strength 1 is `most` mm and half as many degrees again."""

    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        size = _between(least, most, strength)
        move, turn = 1e-3 * size * _unit(rng), np.radians(1.5 * size) * _unit(rng)
        numbers = " ".join(f"{value:.5f}" for value in (*move, *turn))
        if word == "bracket_offset":
            (board,) = _some(rng, hand)
            return Cause("pose_error", word, (f"{word} {board.name} {numbers}",), (Place(board.address),))
        return Cause("pose_error", word, (f"{word} OBJECT {numbers}",))

    return Form("pose_error", word, draw)


def _late(form: str) -> Form:
    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        lines, truth = [], {}
        for board in _some(rng, hand, 2):
            seconds = _between(0.04, 0.42, strength)
            lines.append(f"late {form} seconds={seconds} {_address(board)}")
            truth[f"seconds@{board.address}"] = seconds
        return Cause("latency", f"late {form}", tuple(lines), (), truth if form == "delay" else {})

    return Form("latency", f"late {form}", draw)


def _noise_line(counts: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"counts={counts} axis={int(rng.integers(3))}", {"common_counts": counts}


def _play(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    width, creep, seconds = _around(rng, 1e-4, 4e-4), _around(rng, 0.05, 0.25), _around(rng, 0.4, 3.0)
    return f"fraction={fraction} width_m={width} creep={creep} seconds={seconds}", {}


def _solid(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    seconds = _around(rng, 0.3, 2.0)
    return f"fraction={fraction} seconds={seconds}", {"seconds": seconds}


def _counts(name: str) -> Callable[[float, Rng], tuple[str, dict[str, float]]]:
    return lambda size, rng: (f"counts={size}", {name: size})


def _drifting(low: float, high: float) -> Callable[[float, Rng], tuple[str, dict[str, float]]]:
    """Within some `low` to `high` seconds."""
    return lambda size, rng: (f"counts={size} seconds={_around(rng, low, high)}", {})


def _proximity(share: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"share={share} reach_m={_around(rng, 0.001, 0.004)}", {}


INSIDE: Final = (
    _simple("contact_propagation", "spread film", 0.35, 2.0, _film),
    _simple("contact_propagation", "spread pillars", 0.28, 0.12, lambda slope, rng: (f"slope={slope}", {})),
    _simple("electrode_crosstalk", "coupling resistive", 450, 1700, _resistive),
    _simple("electrode_crosstalk", "coupling traces", 3.0, 25.0, _traces),
    _simple("noise", "noise white", 12, 200, _counts("white_counts")),
    _simple("noise", "noise line", 8, 180, _noise_line),
    _simple("noise", "noise pink", 40, 400, lambda size, rng: (f"counts={size} shared={int(rng.integers(2))}", {})),
    _simple("gain_mismatch", "gain electrode", 0.02, 0.35, lambda std, rng: (f"log_std={std}", {"log_std": std})),
    _board_factor("gain_mismatch", "gain idac"),
    _board_factor("stiffness", "modulus board"),
    _simple("stiffness", "modulus taxels", 0.04, 0.42, lambda std, rng: (f"log_std={std}", {})),
    _simple("baseline_drift", "drift warm_up", 100, 2500, _drifting(60, 400)),
    _simple("baseline_drift", "drift wander", 100, 1000, _drifting(20, 120)),
    _simple("hysteresis", "rheology solid", 0.05, 0.5, _solid),
    _simple("hysteresis", "rheology play", 0.1, 0.6, _play),
    _simple("saturation", "saturation clip", 1300, 600, _counts("counts")),
    _simple("saturation", "saturation soft", 15000, 2500, _counts("counts")),
    _simple("proximity", "proximity image", 0.005, 0.065, _proximity),
    _simple("proximity", "proximity wedge", 0.005, 0.065, _proximity),
    _dead("rest"),
    _dead("stuck"),
    _broken("open"),
    _broken("short"),
    Form("dropout", "silent from", _silent),
    Form("dropout", "silent flaky", _flaky),
    _offset("bracket_offset", 0.3, 2.5),
    _offset("object_offset", 0.25, 1.5),
    _late("delay"),
    _late("lag"),
)  # fmt: skip
"""Causes of the catalogue."""


def _exchange(rng: Rng, hand: Hand, strength: float) -> Cause:
    lines = []
    (board,) = _some(rng, hand)
    axis = int(rng.integers(2))
    count = (board.kind.tx_count, board.kind.rx_count)[axis]
    apart = max(1, min(count - 1, round(1 + 3 * strength)))
    index = int(rng.integers(count - apart))
    lines.append(f"exchange lines {_address(board)} axis={axis} index={index} other={index + apart}")
    word = ("tx", "rx")[axis]
    where = (Place(board.address, word, index), Place(board.address, word, index + apart))
    return Cause(UNKNOWN, "exchange lines", tuple(lines), where)


def _stuck_bit(rng: Rng, hand: Hand, strength: float) -> Cause:
    board = _some(rng, hand)[0]
    bit = 7 + round(3 * strength)
    word = str(rng.choice(["low", "high"]))
    line = f"stuck_bit {word} bit={bit} {_address(board)}"
    return Cause(UNKNOWN, "stuck_bit", (line,), (Place(board.address),))


def _moisture(form: str) -> Form:
    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        (board,) = _some(rng, hand)
        tx, rx = rng.uniform(1, board.kind.tx_count - 2), rng.uniform(1, board.kind.rx_count - 2)
        line = f"moisture {form} {_address(board)} tx={tx:.1f} rx={rx:.1f} radius_m={_around(rng, 0.01, 0.025):.4f}"
        line += f" water={_between(0.08, 0.3, strength)}"
        if form == "drying":
            line += f" seconds={_around(rng, 60, 400):.0f}"
        return Cause(UNKNOWN, f"moisture {form}", (line,), (Place(board.address),))

    return Form(UNKNOWN, f"moisture {form}", draw)


def _reference(ohms: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"ohms={ohms:.0f} seconds={_around(rng, 0.05, 2.0)}", {}


def _indent(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"fraction={fraction} threshold_m={_around(rng, 1e-4, 3e-4)} recovery_s={_around(rng, 20, 500)}", {}


def _bedding(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"fraction={fraction} work_j_m2={_around(rng, 0.1, 10)}", {}


def _bow(counts: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"counts={counts * float(rng.choice([-1.0, 1.0]))}", {}


OUTSIDE: Final = (
    Form(UNKNOWN, "exchange lines", _exchange),
    Form(UNKNOWN, "stuck_bit", _stuck_bit),
    _simple(UNKNOWN, "droop supply", 600, 8000, lambda ohms, rng: (f"ohms={ohms:.0f}", {})),
    _simple(UNKNOWN, "droop reference", 600, 8000, _reference),
    _simple(UNKNOWN, "nonlinear dead_zone", 0.005, 0.05, lambda leak, rng: (f"leak={leak}", {})),
    _moisture("film"),
    _moisture("drying"),
)  # fmt: skip
"""Causes that no effect of the catalogue describes."""

LOOKALIKES: Final = (
    _simple(UNKNOWN, "nonlinear bow", 100, 800, _bow),
    _simple(UNKNOWN, "indent set", 0.2, 0.85, _indent),
    _simple(UNKNOWN, "indent bedding", 0.2, 0.85, _bedding),
)  # fmt: skip
"""Causes outside the catalogue which act, on presses, as one inside: who names that is not wrong."""

ACTS_LIKE: Final = {
    "nonlinear bow": ("gain_mismatch", "stiffness", "saturation"),  # a scale that is bent is steeper at one place
    "indent set": ("hysteresis",),  # unloading does not retrace loading
    "indent bedding": ("gain_mismatch", "stiffness", "saturation"),  # sensitivity that is gone for good
}

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
