"""Which kind of noise a board has too much of.

The parts of noise are not measured independently: 1/f noise reaches beyond its band, and strong white noise leaves
errors in the estimates of all others. So the part that exceeds its limit most is named first, and another one only if
it exceeds what the named ones leave in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from taxel_tools.bench.analysis.fault import BOARD, Fault
from taxel_tools.bench.analysis.noise import NoiseParts

DRIFT_EXPONENT: Final = 0.6
"""Of the growth of squared changes with the lag: above it the board's mean walks, below it is 1/f noise."""

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

_WHERE: Final[Mapping[str, str]] = {
    "white": "each taxel's own: look at the front end's settings, and its integration capacitors",
    "tx": "shared along TX lines: look at the TX drivers' supply",
    "rx": "shared along RX lines: look at shielding and ground of the RX side",
    "board": "shared by all taxels: look at the supply's ripple and the reference",
    "pink": "slow, each taxel's own: look at the layer's contact with the electrodes",
    "pink_board": "slow, shared by all taxels: look at the reference",
    "impulse": "short and shared by conversions that follow one another: look for what switches nearby",
    "wander": "the board's mean walks: look at its temperature, and at the reference",
}

_LEAKS: Final[Mapping[str, Mapping[str, float]]] = {
    "white": {"tx": 0.25, "rx": 0.25, "board": 0.2, "pink": 0.6, "pink_board": 0.2, "wander": 0.3},
    "tx": {"white": 0.2, "rx": 0.4, "board": 0.3, "pink": 0.3, "pink_board": 0.4, "wander": 0.6},
    "rx": {"white": 0.2, "tx": 0.4, "board": 0.3, "pink": 0.3, "pink_board": 0.4, "wander": 0.6},
    "board": {"white": 0.2, "tx": 0.3, "rx": 0.3, "pink": 0.3, "pink_board": 0.4, "wander": 0.6},
    "pink": {"white": 0.8, "tx": 0.3, "rx": 0.3, "board": 0.2, "pink_board": 0.3, "wander": 0.4, "impulse": 0.5},
    "pink_board": {"white": 0.2, "tx": 0.3, "rx": 0.3, "board": 0.9, "pink": 0.4, "wander": 2.0, "impulse": 0.8},
    "wander": {"white": 0.3, "tx": 0.3, "rx": 0.3, "board": 0.6, "pink": 1.0, "pink_board": 2.0, "impulse": 0.8},
    "impulse": {"white": 0.2, "tx": 0.2, "rx": 0.2, "board": 0.2, "pink": 0.3, "pink_board": 0.3, "wander": 0.3},
}
"""Amplitude that a part of amplitude 1 (row) may put into the estimates of the others: measured on emulated boards."""


def noise_faults(parts: NoiseParts, limits: Mapping[str, float]) -> list[Fault]:
    """The kinds of noise beyond their limits. limits: largest amplitude in counts, by the names of `NoiseParts`."""
    amounts = {name: float(getattr(parts, name)) for name in TITLES}
    is_walk = parts.wander_exponent > DRIFT_EXPONENT
    amounts["pink_board" if is_walk else "wander"] = 0.0
    severity = {name: amounts[name] / limits[name] for name in TITLES if name in limits}
    named: list[str] = []
    for name in sorted(severity, key=lambda name: -severity[name]):
        leaked = max((_LEAKS[other].get(name, 0.0) * amounts[other] for other in named), default=0.0)
        if severity[name] > 1.0 and amounts[name] > leaked:
            named.append(name)
    return [
        Fault(
            TITLES[name],
            BOARD,
            f"{amounts[name]:.1f} counts, at most {limits[name]:g}: {_WHERE[name]}",
            severity[name],
        )
        for name in named
    ]
