"""A person presses, and is told what."""

from __future__ import annotations

from taxel.hand import BoardKind
from taxel_tools.testing.operator import Operator


class ManualProbe:
    """Prompts for each press. Which taxel was pressed is seen in the counts; how hard, nobody knows.

    kind: of the board, for what the prompts say.
    """

    name = "operator"
    is_automatic = False
    knows_force = False

    def __init__(self, kind: BoardKind, operator: Operator) -> None:
        self._kind = kind
        self._operator = operator
        self._is_held = False
        self._last = (-1, 0.0)

    def press(self, taxel: int, force_n: float, diameter_m: float) -> None:
        """Ask for it; for no force, ask to let go."""
        if force_n <= 0.0:
            self.release()
            return
        again = "once more: " if (taxel, force_n) == self._last else ""
        crossing = f"TX {self._kind.tx[taxel]}, RX {self._kind.rx[taxel]}"
        self._operator.prompt(
            f"{again}press taxel {taxel} ({crossing}) with the {diameter_m * 1e3:g} mm probe at {force_n:.3g} N and "
            "hold it"
        )
        self._is_held, self._last = True, (taxel, force_n)

    def release(self) -> None:
        """Ask for it, if something is held."""
        if self._is_held:
            self._is_held = False
            self._operator.prompt("let go")

    def close(self) -> None:
        """Nothing to give back."""
