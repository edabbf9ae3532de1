"""Interface of a probe."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from taxel.errors import TaxelError
from taxel.hand import BoardKind
from taxel_tools.open_wire import EmulatedBench
from taxel_tools.testing.operator import Operator


class ProbeError(TaxelError):
    """A probe that cannot carry out an indentation, or cannot be opened."""


@runtime_checkable
class Probe(Protocol):
    """A device that indents one taxel at a time.

    `name`: name in reports. `is_automatic`: the probe needs no operator. `has_known_force`: the applied force equals
    the requested force.
    """

    name: str
    is_automatic: bool
    has_known_force: bool

    def press(self, taxel: int, force_n: float, diameter_m: float) -> None:
        """Indent the centre of a taxel with a flat round tip. Raises `ProbeError`.

        A second force on the same taxel may follow without a release.
        """
        ...

    def release(self) -> None:
        """Release the board and keep clear of it."""
        ...

    def close(self) -> None:
        """Release the board and close the device. May be called twice.

        Errors are suppressed, so that they do not discard the record of a test.
        """
        ...


@dataclass(frozen=True)
class ProbeRequest:
    """Arguments for opening a probe.

    `url`: value of ``--probe``. `kind`: kind of the board. `pitch_m`: distance between taxels. `operator`: person at
    the station. `address`: I2C address of the board. `emulated`: the emulated bench of an emulated board, else None.
    """

    url: str
    kind: BoardKind
    pitch_m: float
    operator: Operator
    address: int
    emulated: EmulatedBench | None = None


class NoProbe:
    """No probe: phases that indent taxels are skipped."""

    name = "none"
    is_automatic = False
    has_known_force = False

    def press(self, taxel: int, force_n: float, diameter_m: float) -> None:
        """Raise `ProbeError`, as there is no probe."""
        raise ProbeError("no probe to indent the board; choose one with --probe")

    def release(self) -> None:
        """Do nothing, as there is no probe."""

    def close(self) -> None:
        """Do nothing, as there is no probe."""


def open_no_probe(request: ProbeRequest) -> NoProbe:
    """Open the probe named `none`, which cannot indent taxels."""
    return NoProbe()
