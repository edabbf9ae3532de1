"""Probe that applies contact forces to an emulated board."""

from typing import Final

import numpy as np

from taxel.hand import BoardKind
from taxel.hand.flat_board import compute_flat_positions
from taxel.link.virtual import VirtualWorld
from taxel.types import FloatArray
from taxel_tools.bench.probe.base import ProbeError, ProbeRequest

TIP_SAMPLES: Final = 41
"""Number of points across the tip, with which its area is divided among the taxels under the tip."""


class EmulatedProbe:
    """A flat tip on a flat emulated board, with a uniform pressure over the area of the tip.

    `first_taxel`: index of the first taxel of the board in the world. `pitch_m`: distance between taxels. `move_s`:
    time of a move between taxels, in world seconds.

    .. warning::
        Not modelled: the higher pressure at the edge of the tip, tilt, and the pitch of a bent board with a described
        layout, which is assumed to be `pitch_m` everywhere.
    """

    name = "emulated probe"
    is_automatic = True
    has_known_force = True

    def __init__(
        self, world: VirtualWorld, kind: BoardKind, first_taxel: int, pitch_m: float, move_s: float = 0.1
    ) -> None:
        """Create a probe that indents the taxels of an emulated board.

        first_taxel: index of the board's first taxel in the emulated hand. pitch_m: distance between taxels.
        move_s: virtual time of a movement.
        """
        self._world = world
        self._kind = kind
        self._first_taxel = first_taxel
        positions_m = compute_flat_positions(kind, pitch_m)
        # Without a described size, a taxel is a square whose side is the pitch.
        self._sides_m = np.full((kind.taxel_count, 2), pitch_m)
        if positions_m is None:  # A bent board has no flat positions: the same pitch is assumed everywhere.
            positions_m = pitch_m * np.stack([kind.row, kind.column], axis=1).astype(np.float64)
        elif kind.layout is not None and kind.surface is not None:
            self._sides_m = kind.surface.size
        self._positions_m = positions_m
        self._move_s = move_s
        self._taxel = -1

    def press(self, taxel: int, force_n: float, diameter_m: float) -> None:
        """Apply a force to a taxel of the emulated board with a tip of the given diameter."""
        if taxel != self._taxel:
            self.release()
            self._world.run(self._move_s)
        self._taxel = taxel
        forces = np.zeros(self._world.taxels)
        last = self._first_taxel + self._kind.taxel_count
        forces[self._first_taxel : last] = force_n * self._compute_force_shares(taxel, diameter_m)
        self._world.set_stimulus(forces)

    def _compute_force_shares(self, taxel: int, diameter_m: float) -> FloatArray:
        """Compute the share of the tip's area over each taxel of the emulated board, f64[taxels].

        The tip is centred on `taxel`. The shares add up to less than 1 if part of the tip is beside the taxels; the
        force on that part has no effect.
        """
        across = (np.arange(TIP_SAMPLES) + 0.5) / TIP_SAMPLES - 0.5
        along_tx, along_rx = np.meshgrid(across * diameter_m, across * diameter_m, indexing="ij")
        is_under_tip = np.hypot(along_tx, along_rx) <= diameter_m / 2.0
        samples = np.stack([along_tx[is_under_tip], along_rx[is_under_tip]], axis=1)
        offsets = self._positions_m - self._positions_m[taxel]
        shares = np.zeros(len(offsets))
        for near in np.flatnonzero((np.abs(offsets) <= (diameter_m + self._sides_m) / 2.0).all(axis=1)):
            is_over_taxel = (np.abs(samples - offsets[near]) <= self._sides_m[near] / 2.0).all(axis=1)
            shares[near] = is_over_taxel.sum() / len(samples)
        return shares

    def release(self) -> None:
        """Remove the force from the emulated board."""
        self._taxel = -1
        self._world.set_stimulus(np.zeros(self._world.taxels))

    def close(self) -> None:
        """Remove the force from the emulated board, as there is no device to close."""
        self.release()


def open_emulated_probe(request: ProbeRequest) -> EmulatedProbe:
    """Open the probe named `emulated`. Raises `ProbeError` for a board that is not emulated."""
    if request.emulated is None:
        raise ProbeError("--probe: 'emulated' requires an emulated board, found a physical one; choose another probe")
    first_taxel = request.emulated.hand.get_slice(request.address).start
    return EmulatedProbe(request.emulated.world, request.kind, first_taxel, request.pitch_m)
