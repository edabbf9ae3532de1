"""Causes of the catalogue that a world may hide, with the parameter ranges of their emulator effects.

The ranges are chosen such that the excess of the gap is between half a floor (strength 0) and six floors (strength 1);
`tools/blind/strengths.py` measures this. Noise and drift that differ between sessions also raise the floor and do not
reach six floors. The score reports accuracy as a function of the measured gap.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from taxel.blind.cause_types import (
    CauseType,
    Rng,
    format_board_argument,
    log_interpolate,
    log_uniform,
    make_whole_hand_cause,
    sample_boards,
    taxels_of,
)
from taxel.blind.hidden import Cause, FaultLocation
from taxel.hand import Hand

DIRECTION_MEAN: Final = 0.7935
"""Ratio of the distance at which a kernel exp(-(|x| + |y|) / length) has decreased to 1/e, averaged over all
directions, to its length along the lines: the mean of 1 / (|cos| + |sin|)."""


SILENT: Final = "silent from"
"""Emulator effect of a board that stops responding at a given time; here at time 0."""


def _film(size: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"length_m={1e-3 * size:.6f}", {"spread_mm": DIRECTION_MEAN * size}


def _resistive(ohm: float, rng: Rng) -> tuple[str, dict[str, float]]:
    tx, rx = (ohm * log_uniform(rng, 0.6, 1.6) for _ in range(2))
    return f"tx_ohm={tx:.0f} rx_ohm={rx:.0f}", {}


def _pillars(slope: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"slope={slope}", {}


def _trace_arguments(picofarad: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Arguments of an effect line of the traces' coupling; no parameters that the score compares."""
    return (
        f"picofarad={picofarad} tx_ohm={log_uniform(rng, 600, 1500):.0f} rx_ohm={log_uniform(rng, 600, 1500):.0f}",
        {},
    )


MAX_CURRENT_FACTOR: Final = 1.35
"""Largest factor on the current of a board's source: above it the counter saturates and reads 0."""


def _board_factor(name: str, emulator_effect: str, max_factor: float = np.inf) -> CauseType:
    """One or two boards with a factor; strength 1 is 1.8 or 1 / 1.8, limited to `max_factor`."""

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        lines, parameters = [], {}
        for board in sample_boards(rng, hand, 2):
            log = log_interpolate(0.045, 0.6, strength) * float(rng.choice([-1.0, 1.0]))
            factor = round(min(float(np.exp(log)), max_factor), 4)
            lines.append(f"{emulator_effect} factor={factor} {format_board_argument(board)}")
            if name == "gain_mismatch":
                parameters[f"scale@{board.address}"] = factor
        return Cause(name, emulator_effect, tuple(lines), (), parameters)

    return CauseType(name, emulator_effect, sample)


def _dead_taxels(variant: str) -> CauseType:
    """Cause type: a patch of dead taxels on one board. variant: "rest" (no signal) or "stuck" (constant count)."""

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        (board,) = sample_boards(rng, hand)
        taxels = taxels_of(hand, board)
        count = max(2, round(log_interpolate(3, 0.4 * len(taxels), strength)))
        first = int(rng.choice(len(taxels)))  # its neighbours are dead too, as where a corner of the layer is detached
        positions = np.array([hand.position[taxel] for taxel in taxels])
        nearest = np.argsort(np.linalg.norm(positions - positions[first], axis=1))[:count].tolist()
        value = int(rng.integers(20000, 45000))
        suffix = "" if variant == "rest" else f" value={value}"
        lines = tuple(
            f"dead {variant} {format_board_argument(board)} taxel={index}{suffix}" for index in sorted(nearest)
        )
        locations = tuple(FaultLocation(board.address, "taxel", taxels[index]) for index in sorted(nearest))
        return Cause("dropout", f"dead {variant}", lines, locations)

    return CauseType("dropout", f"dead {variant}", sample)


def _broken_line(variant: str) -> CauseType:
    """Cause type: one broken line of a board. variant: "open", or "short" to the next line."""

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        (board,) = sample_boards(rng, hand)
        axis = int(rng.integers(2))
        count = (board.kind.tx_count, board.kind.rx_count)[axis]
        index = int(rng.integers(count - (variant == "short")))
        line = f"line {variant} {format_board_argument(board)} axis={axis} index={index}"
        axis_name = ("tx", "rx")[axis]
        locations = [FaultLocation(board.address, axis_name, index)]
        if variant == "short":
            locations.append(FaultLocation(board.address, axis_name, index + 1))
        return Cause("dropout", f"line {variant}", (line,), tuple(locations))

    return CauseType("dropout", f"line {variant}", sample)


def _sample_silent_board(rng: Rng, hand: Hand, strength: float) -> Cause:
    """A cause: one board never sends frames."""
    (board,) = sample_boards(rng, hand)
    line = f"{SILENT} {format_board_argument(board)} seconds=0"
    return Cause("dropout", SILENT, (line,), (FaultLocation(board.address),))


def _sample_flaky_board(rng: Rng, hand: Hand, strength: float) -> Cause:
    """A cause: one board loses frames at random; a stronger cause loses more."""
    (board,) = sample_boards(rng, hand)
    line = f"silent flaky p={log_interpolate(0.08, 0.7, strength)} {format_board_argument(board)}"
    return Cause("dropout", "silent flaky", (line,), (FaultLocation(board.address),))


def _sample_unit_vector(rng: Rng) -> np.ndarray:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def _offset(keyword: str, low_mm: float, high_mm: float) -> CauseType:
    """A bracket or an object is displaced; strength 1 is `high_mm` mm and 1.5 times as many degrees."""

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        size_mm = log_interpolate(low_mm, high_mm, strength)
        translation = 1e-3 * size_mm * _sample_unit_vector(rng)
        rotation = np.radians(1.5 * size_mm) * _sample_unit_vector(rng)
        numbers = " ".join(f"{value:.5f}" for value in (*translation, *rotation))
        if keyword == "bracket_offset":
            (board,) = sample_boards(rng, hand)
            line = f"{keyword} {board.name} {numbers}"
            return Cause("pose_error", keyword, (line,), (FaultLocation(board.address),))
        return Cause("pose_error", keyword, (f"{keyword} OBJECT {numbers}",))

    return CauseType("pose_error", keyword, sample)


def _late_board(variant: str) -> CauseType:
    """Cause type: the signals of two boards are late. variant: "delay", or "lag" (a first-order low-pass filter)."""

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        lines, parameters = [], {}
        for board in sample_boards(rng, hand, 2):
            seconds = log_interpolate(0.04, 0.42, strength)
            lines.append(f"late {variant} seconds={seconds} {format_board_argument(board)}")
            parameters[f"seconds@{board.address}"] = seconds
        return Cause("latency", f"late {variant}", tuple(lines), (), parameters if variant == "delay" else {})

    return CauseType("latency", f"late {variant}", sample)


def _noise_line(counts: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"counts={counts} axis={int(rng.integers(3))}", {"common_counts": counts}


def _noise_pink(counts: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"counts={counts} shared={int(rng.integers(2))}", {}


def _log_std(std: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"log_std={std}", {"log_std": std}


def _play_arguments(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Arguments of an effect line of hysteresis with play; no parameters that the score compares."""
    width, creep, seconds = (
        log_uniform(rng, 1e-4, 4e-4),
        log_uniform(rng, 0.05, 0.25),
        log_uniform(rng, 0.4, 3.0),
    )
    return f"fraction={fraction} width_m={width} creep={creep} seconds={seconds}", {}


def _solid(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    seconds = log_uniform(rng, 0.3, 2.0)
    return f"fraction={fraction} seconds={seconds}", {"seconds": seconds}


def _counts(name: str) -> Callable[[float, Rng], tuple[str, dict[str, float]]]:
    return lambda size, rng: (f"counts={size}", {name: size})


def _drifting(low: float, high: float) -> Callable[[float, Rng], tuple[str, dict[str, float]]]:
    """Counts of a drift with a time constant between `low` and `high` seconds."""
    return lambda size, rng: (f"counts={size} seconds={log_uniform(rng, low, high)}", {})


def _proximity(share: float, rng: Rng) -> tuple[str, dict[str, float]]:
    return f"share={share} reach_m={log_uniform(rng, 0.001, 0.004)}", {}


CATALOGUE_CAUSES: Final = (
    make_whole_hand_cause("contact_propagation", "spread film", 0.35, 2.0, _film),
    make_whole_hand_cause("contact_propagation", "spread pillars", 0.28, 0.12, _pillars),
    make_whole_hand_cause("electrode_crosstalk", "coupling resistive", 450, 1700, _resistive),
    make_whole_hand_cause("electrode_crosstalk", "coupling traces", 3.0, 25.0, _trace_arguments),
    make_whole_hand_cause("noise", "noise white", 12, 200, _counts("white_counts")),
    make_whole_hand_cause("noise", "noise line", 8, 180, _noise_line),
    make_whole_hand_cause("noise", "noise pink", 40, 400, _noise_pink),
    make_whole_hand_cause("gain_mismatch", "gain electrode", 0.02, 0.35, _log_std),
    _board_factor("gain_mismatch", "gain idac", MAX_CURRENT_FACTOR),
    _board_factor("stiffness", "modulus board"),
    make_whole_hand_cause("stiffness", "modulus taxels", 0.04, 0.42, lambda std, rng: (f"log_std={std}", {})),
    make_whole_hand_cause("baseline_drift", "drift warm_up", 100, 2500, _drifting(60, 400)),
    make_whole_hand_cause("baseline_drift", "drift wander", 100, 1000, _drifting(20, 120)),
    make_whole_hand_cause("hysteresis", "rheology solid", 0.05, 0.5, _solid),
    make_whole_hand_cause("hysteresis", "rheology play", 0.1, 0.6, _play_arguments),
    make_whole_hand_cause("saturation", "saturation clip", 1300, 600, _counts("counts")),
    make_whole_hand_cause("saturation", "saturation soft", 15000, 2500, _counts("counts")),
    make_whole_hand_cause("proximity", "proximity image", 0.005, 0.065, _proximity),
    make_whole_hand_cause("proximity", "proximity wedge", 0.005, 0.065, _proximity),
    _dead_taxels("rest"),
    _dead_taxels("stuck"),
    _broken_line("open"),
    _broken_line("short"),
    CauseType("dropout", SILENT, _sample_silent_board),
    CauseType("dropout", "silent flaky", _sample_flaky_board),
    _offset("bracket_offset", 0.3, 2.5),
    _offset("object_offset", 0.25, 1.5),
    _late_board("delay"),
    _late_board("lag"),
)  # fmt: skip
"""Cause types of the catalogue."""

EFFECT_NAMES: Final = tuple(dict.fromkeys(cause_type.name for cause_type in CATALOGUE_CAUSES))
"""Names of the catalogue's effects that worlds hide."""


def list_cause_types(name: str) -> tuple[CauseType, ...]:
    """The cause types of an effect of the catalogue."""
    return tuple(cause_type for cause_type in CATALOGUE_CAUSES if cause_type.name == name)


def sample_nuisance_lines(rng: Rng) -> tuple[str, ...]:
    """Effect lines of small deviations of every skin: tolerances of the gains, and temperature drift."""
    return (
        f"gain electrode log_std={rng.uniform(0.005, 0.02):.4f}",
        f"drift wander counts={rng.uniform(0.5, 2.0):.3f} seconds={rng.uniform(40, 120):.0f}",
    )
