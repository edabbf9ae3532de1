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
    count_half_of_boards,
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


def _make_film_arguments(size: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments of an effect line for a cover film that spreads pressure laterally.

    size: decay length along a line, mm. Returns the arguments and the true value of the parameter that the score
    compares: the 1/e distance averaged over all directions, mm.
    """
    return f"length_m={1e-3 * size:.6f}", {"spread_mm": DIRECTION_MEAN * size}


def _make_resistive_arguments(ohm: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments of an effect line for crosstalk through the resistances of lines.

    ohm: typical resistance of a line. The resistances of the TX lines and of the RX lines are sampled between 0.6 and
    1.6 times this value. Returns the arguments and an empty dictionary, because the score compares no parameter of this
    effect.
    """
    tx, rx = (ohm * log_uniform(rng, 0.6, 1.6) for _ in range(2))
    return f"tx_ohm={tx:.0f} rx_ohm={rx:.0f}", {}


def _make_pillars_arguments(slope: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments of an effect line for compressed pillars that pull down their neighbours.

    slope: decrease of the compression with the distance, metres per metre. Returns the arguments and an empty
    dictionary, because the score compares no parameter of this effect.
    """
    return f"slope={slope}", {}


def _make_traces_arguments(picofarad: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments of an effect line for an additional capacitance between neighbouring lines.

    picofarad: this capacitance. The resistances of the lines are sampled, 600 to 1500 ohm. Returns the arguments and an
    empty dictionary, because the score compares no parameter of this effect.
    """
    return (
        f"picofarad={picofarad} tx_ohm={log_uniform(rng, 600, 1500):.0f} rx_ohm={log_uniform(rng, 600, 1500):.0f}",
        {},
    )


MAX_CURRENT_FACTOR: Final = 1.35
"""Largest factor on the current of a board's current source: above this factor, the counter saturates and reads 0."""


MAX_FRACTION: Final = 0.9
"""Largest `fraction` of the emulator effect `rheology`, which refuses larger values."""

MAX_LOST_SHARE: Final = 0.75
"""Largest share of frames that a board loses: the emulator refuses a larger share with its usual length of bursts."""


def _make_board_factor_type(name: str, emulator_effect: str, max_factor: float = np.inf) -> CauseType:
    """Make a cause type: a quantity of some boards, such as sensitivity or stiffness, has a wrong factor.

    name, emulator_effect: of the cause. max_factor: upper limit of the factor. At strength 1, the factor of a board is
    1.8 or 1 / 1.8.
    """

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        """Sample a cause: up to half of the boards have a wrong factor.

        strength: 0 (factor exp(0.045), 1.05) to 1 (factor exp(0.6), 1.8). Each of these boards gets this factor or its
        reciprocal, at random.
        """
        lines, parameters = [], {}
        for board in sample_boards(rng, hand, count_half_of_boards(hand)):
            log = log_interpolate(0.045, 0.6, strength) * float(rng.choice([-1.0, 1.0]))
            factor = round(min(float(np.exp(log)), max_factor), 4)
            lines.append(f"{emulator_effect} factor={factor} {format_board_argument(board)}")
            if name == "gain_mismatch":
                parameters[f"scale@{board.address}"] = factor
        return Cause(name, emulator_effect, tuple(lines), (), parameters)

    return CauseType(name, emulator_effect, sample)


def _make_dead_taxels_type(variant: str) -> CauseType:
    """Make a cause type: a patch of dead taxels on one board.

    variant: "rest" (no signal) or "stuck" (constant count).
    """

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        """Sample a cause: the taxels of one board that are nearest to a random taxel are dead.

        strength: 0 (three dead taxels) to 1 (40 % of the board).
        """
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


def _make_broken_line_type(variant: str) -> CauseType:
    """Make a cause type: one TX or RX line of a board is broken. variant: "open", or "short" to the next line."""

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        """Sample a cause: a random TX or RX line of a random board is open or shorted. strength: not used."""
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
    """Sample a cause: one random board never sends frames. strength: not used."""
    (board,) = sample_boards(rng, hand)
    line = f"{SILENT} {format_board_argument(board)} seconds=0"
    return Cause("dropout", SILENT, (line,), (FaultLocation(board.address),))


def _sample_flaky_board(rng: Rng, hand: Hand, strength: float) -> Cause:
    """Sample a cause: one random board loses frames at random, 8 % of them at strength 0 and 70 % at strength 1, and at
    most `MAX_LOST_SHARE`.
    """
    (board,) = sample_boards(rng, hand)
    lost = min(log_interpolate(0.08, 0.7, strength), MAX_LOST_SHARE)
    line = f"silent flaky p={lost} {format_board_argument(board)}"
    return Cause("dropout", "silent flaky", (line,), (FaultLocation(board.address),))


def _sample_unit_vector(rng: Rng) -> np.ndarray:
    """Sample a direction uniformly: a unit vector f64[3]."""
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def _make_offset_type(keyword: str, low_mm: float, high_mm: float) -> CauseType:
    """Make a cause type: the bracket of a board, or the grasped object, is displaced from its nominal pose.

    keyword: "bracket_offset" or "object_offset". low_mm, high_mm: displacements at strength 0 and at strength 1; the
    rotation in degrees is 1.5 times the displacement in millimetres.
    """

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        """Sample a cause: a displacement and a rotation in random directions. strength: 0 (smallest) to 1 (largest).

        The effect line has the name of a bracket, or the placeholder OBJECT, then metres and a rotation vector in
        radians.
        """
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


def _make_late_board_type(variant: str) -> CauseType:
    """Make a cause type: the signals of some boards are late.

    variant: "delay" (shifted in time) or "lag" (a first-order low-pass filter).
    """

    def sample(rng: Rng, hand: Hand, strength: float) -> Cause:
        """Sample a cause: up to half of the boards are late by 0.04 s at strength 0 and 0.42 s at strength 1.

        The true delay is a parameter that the score compares; a lag has no such parameter.
        """
        lines, parameters = [], {}
        for board in sample_boards(rng, hand, count_half_of_boards(hand)):
            seconds = log_interpolate(0.04, 0.42, strength)
            lines.append(f"late {variant} seconds={seconds} {format_board_argument(board)}")
            parameters[f"seconds@{board.address}"] = seconds
        return Cause("latency", f"late {variant}", tuple(lines), (), parameters if variant == "delay" else {})

    return CauseType("latency", f"late {variant}", sample)


def _make_line_noise_arguments(counts: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments and the true parameter of noise that is common to one line or one scan.

    counts: standard deviation. The axis is sampled: noise common to a TX line, to an RX line or to a whole scan.
    """
    return f"counts={counts} axis={int(rng.integers(3))}", {"common_counts": counts}


def _make_pink_noise_arguments(counts: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments of 1/f noise, either independent for each taxel or common to a board.

    counts: standard deviation. Returns the arguments and an empty dictionary, because the score compares no parameter
    of this effect.
    """
    return f"counts={counts} shared={int(rng.integers(2))}", {}


def _make_log_std_arguments(std: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments and the true parameter of a log-normal gain of each taxel.

    std: standard deviation of the logarithm of the gain.
    """
    return f"log_std={std}", {"log_std": std}


def _make_play_arguments(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments of an effect line for hysteresis by play operators.

    fraction: share of the compression that the play operators hold back. The width of the play (0.1 to 0.4 mm), the
    creep (share 0.05 to 0.25) and its time constant (0.4 to 3 s) are sampled. Returns the arguments and an empty
    dictionary, because the score compares no parameter of this effect.
    """
    width, creep, seconds = (
        log_uniform(rng, 1e-4, 4e-4),
        log_uniform(rng, 0.05, 0.25),
        log_uniform(rng, 0.4, 3.0),
    )
    share = min(fraction, MAX_FRACTION)
    return f"fraction={share} width_m={width} creep={creep} seconds={seconds}", {}


def _make_solid_arguments(fraction: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments and the true parameter of a standard linear solid, a layer that creeps under load.

    fraction: share of the compliance that acts through a dashpot. The time constant is sampled, 0.3 to 2 s.
    """
    seconds = log_uniform(rng, 0.3, 2.0)
    return f"fraction={min(fraction, MAX_FRACTION)} seconds={seconds}", {"seconds": seconds}


def _make_counts_formatter(name: str) -> Callable[[float, Rng], tuple[str, dict[str, float]]]:
    """Make a function that formats a number of counts as the argument of an effect line.

    The function also returns the number as a true parameter. name: of this parameter in a report.
    """
    return lambda size, rng: (f"counts={size}", {name: size})


def _make_drift_formatter(low: float, high: float) -> Callable[[float, Rng], tuple[str, dict[str, float]]]:
    """Make a function that formats the arguments of a drift: its size in counts and a random time constant.

    low, high: limits of the time constant, seconds. The score compares no parameter of a drift.
    """
    return lambda size, rng: (f"counts={size} seconds={log_uniform(rng, low, high)}", {})


def _make_proximity_arguments(share: float, rng: Rng) -> tuple[str, dict[str, float]]:
    """Make the arguments of an effect line for a response before contact.

    share: response at gap 0, as a share of the fringe capacitance. The reach is sampled, 1 to 4 mm. Returns the
    arguments and an empty dictionary, because the score compares no parameter of this effect.
    """
    return f"share={share} reach_m={log_uniform(rng, 0.001, 0.004)}", {}


CATALOGUE_CAUSES: Final = (
    make_whole_hand_cause("contact_propagation", "spread film", 0.35, 2.0, _make_film_arguments),
    make_whole_hand_cause("contact_propagation", "spread pillars", 0.28, 0.12, _make_pillars_arguments),
    make_whole_hand_cause("electrode_crosstalk", "coupling resistive", 450, 1700, _make_resistive_arguments),
    make_whole_hand_cause("electrode_crosstalk", "coupling traces", 3.0, 25.0, _make_traces_arguments),
    make_whole_hand_cause("noise", "noise white", 12, 200, _make_counts_formatter("white_counts")),
    make_whole_hand_cause("noise", "noise line", 8, 180, _make_line_noise_arguments),
    make_whole_hand_cause("noise", "noise pink", 40, 400, _make_pink_noise_arguments),
    make_whole_hand_cause("gain_mismatch", "gain electrode", 0.02, 0.35, _make_log_std_arguments),
    _make_board_factor_type("gain_mismatch", "gain idac", MAX_CURRENT_FACTOR),
    _make_board_factor_type("stiffness", "modulus board"),
    make_whole_hand_cause("stiffness", "modulus taxels", 0.04, 0.42, lambda std, rng: (f"log_std={std}", {})),
    make_whole_hand_cause("baseline_drift", "drift warm_up", 100, 2500, _make_drift_formatter(60, 400)),
    make_whole_hand_cause("baseline_drift", "drift wander", 100, 1000, _make_drift_formatter(20, 120)),
    make_whole_hand_cause("hysteresis", "rheology solid", 0.05, 0.5, _make_solid_arguments),
    make_whole_hand_cause("hysteresis", "rheology play", 0.1, 0.6, _make_play_arguments),
    make_whole_hand_cause("saturation", "saturation clip", 1300, 600, _make_counts_formatter("counts")),
    make_whole_hand_cause("saturation", "saturation soft", 15000, 2500, _make_counts_formatter("counts")),
    make_whole_hand_cause("proximity", "proximity image", 0.005, 0.065, _make_proximity_arguments),
    make_whole_hand_cause("proximity", "proximity wedge", 0.005, 0.065, _make_proximity_arguments),
    _make_dead_taxels_type("rest"),
    _make_dead_taxels_type("stuck"),
    _make_broken_line_type("open"),
    _make_broken_line_type("short"),
    CauseType("dropout", SILENT, _sample_silent_board),
    CauseType("dropout", "silent flaky", _sample_flaky_board),
    _make_offset_type("bracket_offset", 0.3, 2.5),
    _make_offset_type("object_offset", 0.25, 1.5),
    _make_late_board_type("delay"),
    _make_late_board_type("lag"),
)  # fmt: skip
"""Cause types of the catalogue."""

EFFECT_NAMES: Final = tuple(dict.fromkeys(cause_type.name for cause_type in CATALOGUE_CAUSES))
"""Names of the catalogue's effects that worlds hide."""


def list_cause_types(name: str) -> tuple[CauseType, ...]:
    """List the cause types that produce one effect of the diagnosis's catalogue.

    name: of the effect, such as "noise".
    """
    return tuple(cause_type for cause_type in CATALOGUE_CAUSES if cause_type.name == name)


def sample_nuisance_lines(rng: Rng) -> tuple[str, ...]:
    """Sample the effect lines of small deviations that every skin has: gain tolerances and temperature drift."""
    return (
        f"gain electrode log_std={rng.uniform(0.005, 0.02):.4f}",
        f"drift wander counts={rng.uniform(0.5, 2.0):.3f} seconds={rng.uniform(40, 120):.0f}",
    )
