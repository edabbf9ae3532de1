"""The skin of `taxel monitor demo:`: an emulated hand over which contacts move, without hardware."""

from __future__ import annotations

import os
import threading
import time
from typing import Final

import numpy as np

from taxel.hand import Hand, load_hand
from taxel.hand.indentation import Indentation, compute_force_shares
from taxel.hand.unrolled_layout import SIDES
from taxel.hand.world import WorldSettings, format_world
from taxel.link.emulator import EmulatorLink
from taxel.link.errors import LinkError
from taxel.skin import Skin
from taxel.types import FloatArray

DEMO_URL: Final = "demo:"

DEMO_BASELINE_FRAMES: Final = 20
"""Number of frames of each board's baseline: one second, so that the first contact follows soon after the start."""

SCANS_HZ: Final = 19.0
"""Scans per second of the packaged hand at 400 kHz, from which the end of the baseline follows."""

START_S: Final = 1.0
"""Time for the start of the emulator and its handshake, seconds."""

BOARD_S: Final = 1.6
"""Time in which a contact moves over one board, seconds."""

STEP_S: Final = 0.03
"""Interval between two changes of the forces, seconds: shorter than a scan."""

FORCE_N, DIAMETER_M = 6.0, 0.014
"""Force of a contact in the middle of a board, newtons, and diameter of its probe, metres: a fingertip."""


class MovingContacts:
    """Contacts that move along the fingers of a hand to the palm, one on each finger, without end.

    A hand whose boards are not those of a packaged hand has one contact, which moves over all boards.
    """

    def __init__(self, hand: Hand) -> None:
        """Plan the boards over which each contact moves.

        On a packaged hand, each contact moves over one column of boards of the palm side, from the fingertip downwards.
        On another hand, one contact moves over all boards.
        """
        self._hand = hand
        names = {board.name for board in hand.boards}
        _, grid, _ = SIDES[0]
        columns = [[name for name in column if name in names] for column in zip(*grid, strict=True)]
        tours = [column for column in columns if column]
        self._tours = tours or [[board.name for board in hand.boards]]

    def compute_forces(self, elapsed_s: float) -> FloatArray:
        """Compute the force on each taxel, newtons, f64[n]. elapsed_s: time since the first contact.

        Each contact moves over one board in `BOARD_S`, from the first row to the last; its force rises to `FORCE_N` in
        the middle of the board. The contacts are shifted in time against each other.
        """
        forces = np.zeros(self._hand.n_taxels)
        if elapsed_s < 0.0:
            return forces
        for number, tour in enumerate(self._tours):
            step = elapsed_s / BOARD_S + number / len(self._tours)
            board = self._hand.find_board(tour[int(step) % len(tour)])
            progress = step % 1.0
            row = progress * float(board.kind.row.max())
            # The contact follows the median column of the taxels nearest to its row. A layout may have rows without
            # taxels, so the nearest taxels can be more than half a row away.
            distance = np.abs(board.kind.row - row)
            column = float(np.median(board.kind.column[distance <= distance.min() + 0.5]))
            force_n = FORCE_N * float(np.sin(np.pi * progress)) ** 0.5
            contact = Indentation(board.name, row, column, force_n, 0.0, diameter_m=DIAMETER_M)
            forces += force_n * compute_force_shares(self._hand, contact)
        return forces


class DemoLink(EmulatorLink):
    """An emulated skin in real time on which contacts move. A thread applies the forces of the contacts."""

    def __init__(self, hand: Hand, baseline_frames: int = DEMO_BASELINE_FRAMES) -> None:
        """Start the emulator. baseline_frames: frames of each board without contact, before the first contact."""
        super().__init__(format_world(hand, WorldSettings(seed=1)), live_taxels=hand.n_taxels)
        self.name = DEMO_URL
        self._contacts = MovingContacts(hand)
        self._first_s = time.monotonic() + START_S + baseline_frames / SCANS_HZ
        self._is_closed = threading.Event()
        self._thread = threading.Thread(target=self._move, name="moving contacts", daemon=True)
        self._thread.start()

    def _move(self) -> None:
        """Apply the forces of the contacts until the link is closed or the emulator has ended."""
        while not self._is_closed.wait(STEP_S):
            try:
                self.apply(self._contacts.compute_forces(time.monotonic() - self._first_s))
            except LinkError:
                return

    def close(self) -> None:
        """End the contacts and the emulator."""
        self._is_closed.set()
        self._thread.join()
        super().close()


def open_demo(
    hand: str | os.PathLike[str] | None = None,
    rate_hz: float | None = None,
    baseline_frames: int = DEMO_BASELINE_FRAMES,
) -> Skin:
    """Open the skin of the demonstration. hand: packaged hand or description file; None: the default hand.

    rate_hz: scans per second; None: the highest possible rate. baseline_frames: frames before the first contact.
    """
    description = load_hand("original" if hand is None else hand)
    link = DemoLink(description, baseline_frames)
    try:
        return Skin(link, description, rate_hz)
    except BaseException:
        link.close()
        raise
