"""Out-of-catalogue causes: some that no effect of the catalogue describes, and some that resemble an effect."""

from typing import Final

from taxel.blind.cause_types import (
    CauseType,
    Rng,
    format_board_argument,
    log_interpolate,
    log_uniform,
    make_whole_hand_cause,
    sample_boards,
)
from taxel.blind.hidden import UNKNOWN, Cause, FaultLocation
from taxel.hand import Hand


def _sample_exchanged_lines(rng: Rng, hand: Hand, strength: float) -> Cause:
    """Sample a cause: two TX or RX lines of a board are exchanged. strength: 0 to 1, sets their distance in lines."""
    (board,) = sample_boards(rng, hand)
    axis = int(rng.integers(2))
    count = (board.kind.tx_count, board.kind.rx_count)[axis]
    distance = max(1, min(count - 1, round(1 + 3 * strength)))
    index = int(rng.integers(count - distance))
    line = f"exchange lines {format_board_argument(board)} axis={axis} index={index} other={index + distance}"
    axis_name = ("tx", "rx")[axis]
    locations = tuple(FaultLocation(board.address, axis_name, number) for number in (index, index + distance))
    return Cause(UNKNOWN, "exchange lines", (line,), locations)


def _sample_stuck_bit(rng: Rng, hand: Hand, strength: float) -> Cause:
    """Sample a cause: one bit of all counts of a board is stuck, bit 7 at strength 0 and bit 10 at strength 1."""
    board = sample_boards(rng, hand)[0]
    bit = 7 + round(3 * strength)
    level = str(rng.choice(["low", "high"]))
    line = f"stuck_bit {level} bit={bit} {format_board_argument(board)}"
    return Cause(UNKNOWN, "stuck_bit", (line,), (FaultLocation(board.address),))


def _make_moisture_type(variant: str) -> CauseType:
    """Make a cause type: a wet spot on a board. variant: keyword of the world file; "drying" has a time constant."""

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        """Sample a cause: a wet spot at a random position of a board.

        strength: 0 to 1, sets the water content, 0.08 to 0.3 of the pore volume.
        """
        (board,) = sample_boards(rng, hand)
        tx, rx = rng.uniform(1, board.kind.layout_shape[0] - 2), rng.uniform(1, board.kind.layout_shape[1] - 2)
        radius_m = log_uniform(rng, 0.01, 0.025)
        line = f"moisture {variant} {format_board_argument(board)} tx={tx:.1f} rx={rx:.1f} radius_m={radius_m:.4f}"
        line += f" water={log_interpolate(0.08, 0.3, strength)}"
        if variant == "drying":
            line += f" seconds={log_uniform(rng, 60, 400):.0f}"
        return Cause(UNKNOWN, f"moisture {variant}", (line,), (FaultLocation(board.address),))

    return CauseType(UNKNOWN, f"moisture {variant}", sample)


def _make_reference_arguments(ohms: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments of an effect line for a reference voltage that falls under load.

    ohms: source resistance of the reference. The time constant of the fall is sampled, 0.05 to 2 s. Returns the
    arguments and an empty dictionary, because the score compares no parameter of this effect.
    """
    return f"ohms={ohms:.0f} seconds={log_uniform(rng, 0.05, 2.0)}", {}


def _make_compression_set_arguments(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments of an effect line for compression set, an indentation that remains after a contact.

    fraction: share (0 to 1) of the compression above a threshold that remains. The threshold (0.1 to 0.3 mm) and the
    time constant of the recovery (20 to 500 s) are sampled. Returns the arguments and an empty dictionary, because the
    score compares no parameter of this effect.
    """
    return (
        f"fraction={fraction} threshold_m={log_uniform(rng, 1e-4, 3e-4)} recovery_s={log_uniform(rng, 20, 500)}",
        {},
    )


def _make_bedding_arguments(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments of an effect line for bedding, a permanent flattening of the pillar tips.

    fraction: share (0 to 1, no unit) of the compression that is lost when the tips are completely flat. The work per
    area at which 63 % of this loss is reached, `work_j_m2`, is sampled, 0.1 to 10 J/m^2. Returns the arguments and an
    empty dictionary, because the score compares no parameter of this effect.
    """
    return f"fraction={fraction} work_j_m2={log_uniform(rng, 0.1, 10)}", {}


def _make_bow_arguments(counts: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments of an effect line for a bent characteristic curve of the converter.

    counts: deviation from the straight line at half of full scale, without its sign, which is sampled. Returns the
    arguments and an empty dictionary, because the score compares no parameter of this effect.
    """
    return f"counts={counts * float(rng.choice([-1.0, 1.0]))}", {}


OUT_OF_CATALOGUE: Final = (
    CauseType(UNKNOWN, "exchange lines", _sample_exchanged_lines),
    CauseType(UNKNOWN, "stuck_bit", _sample_stuck_bit),
    make_whole_hand_cause(UNKNOWN, "droop supply", 600, 8000, lambda ohms, rng: (f"ohms={ohms:.0f}", {})),
    make_whole_hand_cause(UNKNOWN, "droop reference", 600, 8000, _make_reference_arguments),
    make_whole_hand_cause(UNKNOWN, "nonlinear dead_zone", 0.005, 0.05, lambda leak, rng: (f"leak={leak}", {})),
    _make_moisture_type("film"),
    _make_moisture_type("drying"),
)  # fmt: skip
"""Cause types that no effect of the catalogue describes."""

LOOKALIKES: Final = (
    make_whole_hand_cause(UNKNOWN, "nonlinear bow", 100, 800, _make_bow_arguments),
    make_whole_hand_cause(UNKNOWN, "indent set", 0.2, 0.85, _make_compression_set_arguments),
    make_whole_hand_cause(UNKNOWN, "indent bedding", 0.2, 0.85, _make_bedding_arguments),
)  # fmt: skip
"""Cause types whose signature resembles that of an effect of the catalogue; naming this effect is accepted."""

SIMILAR_EFFECTS: Final = {
    "nonlinear bow": (
        "gain_mismatch",
        "stiffness",
        "saturation",
    ),  # a bent characteristic has a larger slope at some level
    "indent set": ("hysteresis",),  # the unloading curve differs from the loading curve
    "indent bedding": ("gain_mismatch", "stiffness", "saturation"),  # a permanent loss of sensitivity
}
