"""Noise faults of a board.

The components of noise are not measured independently: 1/f noise extends beyond its band, and strong white noise causes
errors in the estimates of all other components. The component with the largest excess over its limit is therefore
reported first, and another component only if it exceeds the leakage of the reported ones.
"""

from collections.abc import Mapping
from typing import Final

from taxel_tools.bench.analysis.fault import BOARD, Fault
from taxel_tools.bench.analysis.noise import NoiseParts

DRIFT_EXPONENT: Final = 0.6
"""Exponent of the growth of squared changes with the lag: drift of the board's mean above, 1/f noise below."""

TITLES: Final[Mapping[str, str]] = {
    "white": "white noise",
    "tx": "TX line noise",
    "rx": "RX line noise",
    "board": "board noise",
    "pink": "1/f noise",
    "pink_board": "1/f noise",
    "impulse": "impulses",
    "wander": "drift",
}

_ADVICE: Final[Mapping[str, str]] = {
    "white": "independent in each taxel; check the scan settings and the integration capacitors",
    "tx": "shared along TX lines; check the supply of the TX drivers",
    "rx": "shared along RX lines; check shielding and ground of the RX side",
    "board": "shared by all taxels; check the ripple of the supply and the reference",
    "pink": "slow, independent in each taxel; check the contact between layer and electrodes",
    "pink_board": "slow, shared by all taxels; check the reference",
    "impulse": "short, shared by successive conversions; check for switching loads nearby",
    "wander": "drift of the mean of the board; check its temperature and the reference",
}

_LEAKAGE: Final[Mapping[str, Mapping[str, float]]] = {
    "white": {"tx": 0.25, "rx": 0.25, "board": 0.2, "pink": 0.6, "pink_board": 0.2, "wander": 0.3},
    "tx": {"white": 0.2, "rx": 0.4, "board": 0.3, "pink": 0.3, "pink_board": 0.4, "wander": 0.6},
    "rx": {"white": 0.2, "tx": 0.4, "board": 0.3, "pink": 0.3, "pink_board": 0.4, "wander": 0.6},
    "board": {"white": 0.2, "tx": 0.3, "rx": 0.3, "pink": 0.3, "pink_board": 0.4, "wander": 0.6},
    "pink": {"white": 0.8, "tx": 0.3, "rx": 0.3, "board": 0.2, "pink_board": 0.3, "wander": 0.4, "impulse": 0.5},
    "pink_board": {"white": 0.2, "tx": 0.3, "rx": 0.3, "board": 0.9, "pink": 0.4, "wander": 2.0, "impulse": 0.8},
    "wander": {"white": 0.3, "tx": 0.3, "rx": 0.3, "board": 0.6, "pink": 1.0, "pink_board": 2.0, "impulse": 0.8},
    "impulse": {"white": 0.2, "tx": 0.2, "rx": 0.2, "board": 0.2, "pink": 0.3, "pink_board": 0.3, "wander": 0.3},
}
"""Leakage between components, measured on emulated boards.

A component of amplitude 1 (row) may cause this amplitude in the estimate of another component.
"""


def find_noise_faults(parts: NoiseParts, limits: Mapping[str, float]) -> list[Fault]:
    """Return the faults of a board whose noise exceeds the limits, the largest excess first.

    limits: largest permitted amplitude in counts, by name in `TITLES`. Leakage is the part of a component that appears
    in the estimate of another component (`_LEAKAGE`). A component is reported only if it exceeds the leakage of the
    components reported before it. A slow change of the board is either drift or 1/f noise of the board ("pink_board").
    The exponent with which the change grows over time decides between these two; the other component is not evaluated.
    """
    amplitudes = parts.amplitudes()
    is_drift = parts.mean_change_exponent > DRIFT_EXPONENT
    amplitudes["pink_board" if is_drift else "wander"] = 0.0
    severity = {name: amplitudes[name] / limits[name] for name in TITLES if name in limits}
    reported: list[str] = []
    for name in sorted(severity, key=lambda name: -severity[name]):
        leakage = max((_LEAKAGE[other].get(name, 0.0) * amplitudes[other] for other in reported), default=0.0)
        if severity[name] > 1.0 and amplitudes[name] > leakage:
            reported.append(name)
    return [
        Fault(
            TITLES[name],
            BOARD,
            f"{amplitudes[name]:.1f} counts, limit {limits[name]:g}: {_ADVICE[name]}",
            severity[name],
        )
        for name in reported
    ]
