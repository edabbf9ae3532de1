"""What a probe can do."""

from __future__ import annotations

from typing import Protocol

from taxel.errors import TaxelError


class ProbeError(TaxelError):
    """A probe that cannot do what is asked of it."""


class Probe(Protocol):
    """Something that presses one place of a board.

    `name`: for reports. `is_automatic`: it needs no person. `knows_force`: the force that is asked for is the force
    that acts.
    """

    name: str
    is_automatic: bool
    knows_force: bool

    def press(self, taxel: int, force_n: float, diameter_m: float) -> None:
        """Press the middle of a taxel with a flat round tip; from an earlier force at this place it goes on, without
        letting go.

        Raises `ProbeError`.
        """
        ...

    def release(self) -> None:
        """Let go, and stay clear of the board."""
        ...

    def close(self) -> None:
        """Let go, and give back what the probe is driven by. May be called twice; a test's record is not lost by it, so
        what fails here is left alone.
        """
        ...


class NoProbe:
    """There is none: phases that press do not run."""

    name = "none"
    is_automatic = False
    knows_force = False

    def press(self, taxel: int, force_n: float, diameter_m: float) -> None:
        """Raises `ProbeError`."""
        raise ProbeError("no probe is there to press with: give --probe")

    def release(self) -> None:
        """Nothing to let go."""

    def close(self) -> None:
        """Nothing to give back."""
