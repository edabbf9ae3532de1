"""Probe operated by a person on instruction."""

from taxel.hand import BoardKind
from taxel_tools.bench.probe.base import ProbeRequest
from taxel_tools.testing.operator import Operator


class ManualProbe:
    """Probe that instructs an operator for each indentation; the applied force is unknown.

    `kind`: kind of the board, for the text of the instructions.
    """

    name = "operator"
    is_automatic = False
    has_known_force = False

    def __init__(self, kind: BoardKind, operator: Operator) -> None:
        """Create a probe whose indentations are made by hand. operator: the person who receives the instructions."""
        self._kind = kind
        self._operator = operator
        self._is_pressed = False
        self._last_request = (-1, 0.0)

    def press(self, taxel: int, force_n: float, diameter_m: float) -> None:
        """Instruct the operator to indent a taxel, or to release it for a force of 0."""
        if force_n <= 0.0:
            self.release()
            return
        prefix = "once more: " if (taxel, force_n) == self._last_request else ""
        crossing = f"TX {self._kind.tx[taxel]}, RX {self._kind.rx[taxel]}"
        self._operator.prompt(
            f"{prefix}press taxel {taxel} ({crossing}) with the {diameter_m * 1e3:g} mm probe at {force_n:.3g} N and "
            "hold the force"
        )
        self._is_pressed, self._last_request = True, (taxel, force_n)

    def release(self) -> None:
        """Instruct the operator to remove the probe, if a taxel is indented."""
        if self._is_pressed:
            self._is_pressed = False
            self._operator.prompt("release the probe")

    def close(self) -> None:
        """Do nothing, as a probe held by hand has no device."""


def open_manual_probe(request: ProbeRequest) -> ManualProbe:
    """Open the probe named `operator`, which is held by hand."""
    return ManualProbe(request.kind, request.operator)
