"""Causes outside the catalogue: those that no effect describes, and those that act, on presses, as one inside."""

from __future__ import annotations

from typing import Final

from taxel.blind.form import Form, Rng, address_word, around, between, simple, some_boards
from taxel.blind.hidden import UNKNOWN, Cause, Place
from taxel.hand import Hand


def _exchange(rng: Rng, hand: Hand, strength: float) -> Cause:
    lines = []
    (board,) = some_boards(rng, hand)
    axis = int(rng.integers(2))
    count = (board.kind.tx_count, board.kind.rx_count)[axis]
    apart = max(1, min(count - 1, round(1 + 3 * strength)))
    index = int(rng.integers(count - apart))
    lines.append(f"exchange lines {address_word(board)} axis={axis} index={index} other={index + apart}")
    word = ("tx", "rx")[axis]
    where = (Place(board.address, word, index), Place(board.address, word, index + apart))
    return Cause(UNKNOWN, "exchange lines", tuple(lines), where)


def _stuck_bit(rng: Rng, hand: Hand, strength: float) -> Cause:
    board = some_boards(rng, hand)[0]
    bit = 7 + round(3 * strength)
    word = str(rng.choice(["low", "high"]))
    line = f"stuck_bit {word} bit={bit} {address_word(board)}"
    return Cause(UNKNOWN, "stuck_bit", (line,), (Place(board.address),))


def _moisture(form: str) -> Form:
    def draw(rng: Rng, hand: Hand, strength: float) -> Cause:
        (board,) = some_boards(rng, hand)
        tx, rx = rng.uniform(1, board.kind.tx_count - 2), rng.uniform(1, board.kind.rx_count - 2)
        line = f"moisture {form} {address_word(board)} tx={tx:.1f} rx={rx:.1f} radius_m={around(rng, 0.01, 0.025):.4f}"
        line += f" water={between(0.08, 0.3, strength)}"
        if form == "drying":
            line += f" seconds={around(rng, 60, 400):.0f}"
        return Cause(UNKNOWN, f"moisture {form}", (line,), (Place(board.address),))

    return Form(UNKNOWN, f"moisture {form}", draw)


def _reference(ohms: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"ohms={ohms:.0f} seconds={around(rng, 0.05, 2.0)}", {}


def _indent(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"fraction={fraction} threshold_m={around(rng, 1e-4, 3e-4)} recovery_s={around(rng, 20, 500)}", {}


def _bedding(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"fraction={fraction} work_j_m2={around(rng, 0.1, 10)}", {}


def _bow(counts: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"counts={counts * float(rng.choice([-1.0, 1.0]))}", {}


OUTSIDE: Final = (
    Form(UNKNOWN, "exchange lines", _exchange),
    Form(UNKNOWN, "stuck_bit", _stuck_bit),
    simple(UNKNOWN, "droop supply", 600, 8000, lambda ohms, rng: (f"ohms={ohms:.0f}", {})),
    simple(UNKNOWN, "droop reference", 600, 8000, _reference),
    simple(UNKNOWN, "nonlinear dead_zone", 0.005, 0.05, lambda leak, rng: (f"leak={leak}", {})),
    _moisture("film"),
    _moisture("drying"),
)  # fmt: skip
"""Causes that no effect of the catalogue describes."""

LOOKALIKES: Final = (
    simple(UNKNOWN, "nonlinear bow", 100, 800, _bow),
    simple(UNKNOWN, "indent set", 0.2, 0.85, _indent),
    simple(UNKNOWN, "indent bedding", 0.2, 0.85, _bedding),
)  # fmt: skip
"""Causes outside the catalogue which act, on presses, as one inside: who names that is not wrong."""

ACTS_LIKE: Final = {
    "nonlinear bow": ("gain_mismatch", "stiffness", "saturation"),  # a scale that is bent is steeper at one place
    "indent set": ("hysteresis",),  # unloading does not retrace loading
    "indent bedding": ("gain_mismatch", "stiffness", "saturation"),  # sensitivity that is gone for good
}
