"""A board on the bench: its wire, what it says of itself, what presses it, and what has been seen of it so far."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel.hand import BoardKind, Hand
from taxel_protocol.layout import packer_of, unpack
from taxel_protocol.limits import REGISTER_SETTINGS
from taxel_protocol.registers import ScanSettings
from taxel_tools.application import read_identity, read_status
from taxel_tools.bench.analysis.conclusion import taxels_of
from taxel_tools.bench.analysis.fault import Fault
from taxel_tools.bench.analysis.noise import NoiseParts
from taxel_tools.bench.capture import Capture
from taxel_tools.bench.pictures import MEDIA_TYPE
from taxel_tools.bench.probe import NoProbe, Probe
from taxel_tools.bench.readout import Readout, readout_of
from taxel_tools.errors import BoardError, NackError, TransferError
from taxel_tools.scheduler import run
from taxel_tools.procedure import Procedure, Transfer
from taxel_tools.testing.log import PhaseLog
from taxel_tools.wires import BoardWire

ATTEMPTS: Final = 8

T = TypeVar("T")


@dataclass
class Evidence:
    """Faults that the phases have seen. `pressed` is None until taxels were pressed."""

    at_rest: list[Fault] = field(default_factory=list)
    pressed: list[Fault] | None = None
    board: list[Fault] = field(default_factory=list)


@dataclass
class Station:
    """One board under test. `untouched_s`: how long the record of the untouched board is that all phases share.
    `draws`: whether phases draw pictures; `was_measured`: whether any phase has asked the board for anything.
    """

    wire: BoardWire
    address: int
    kind: BoardKind
    hand: Hand | None
    identity: dict[str, Any]
    settings: dict[str, int]
    readout: Readout
    probe: Probe
    untouched_s: float = 1.0
    evidence: Evidence = field(default_factory=Evidence)
    noise: NoiseParts | None = None
    draws: bool = True
    was_measured: bool = False
    _untouched: Capture | None = None

    @property
    def largest_count(self) -> float:
        """Largest count of a conversion under the board's scan settings (protocol/SPEC.md)."""
        return float(self.settings["sub_conversions"] * self.settings["sense_clock_divider"])

    def untouched(self, seconds: float, log: PhaseLog | None = None) -> Capture:
        """Frames while nothing touches the board, `seconds` of them or more; taken once. log: is told of progress.

        Raises `BoardError`.
        """
        self.untouched_s = max(self.untouched_s, seconds)
        if self._untouched is None or self._untouched.seconds < 0.9 * seconds:
            self._untouched = self.frames_for(self.untouched_s, log)
        return self._untouched

    def frames_for(self, seconds: float, log: PhaseLog | None = None) -> Capture:
        """Frames from now on, for so long. Raises `BoardError`."""

        def is_enough(count: int, elapsed: float) -> bool:
            if log is not None:
                log.progress(elapsed / seconds)
            return elapsed >= seconds and count > 1

        return self._frames(is_enough)

    def frames(self, count: int, skip: int = 0) -> Capture:
        """So many frames from now on, after `skip` that are thrown away. Raises `BoardError`."""
        if skip:
            self._frames(lambda frames, elapsed: frames >= skip)
        return self._frames(lambda frames, elapsed: frames >= count)

    def _frames(self, until: Callable[[int, float], bool]) -> Capture:
        self.was_measured = True
        return self.readout.frames(until)

    def middle_taxels(self, count: int) -> list[int]:
        """Sound taxels whose neighbours on all sides are taxels too, spread over the board; if there are none, any."""
        has = np.pad(self.kind.crossings, 1)
        inner = ~self.faulty()
        for down in (0, 1, 2):
            for right in (0, 1, 2):
                inner &= has[self.kind.tx.astype(int) + down, self.kind.rx.astype(int) + right]
        places = np.nonzero(inner)[0] if inner.any() else np.arange(self.kind.taxel_count)
        picked = np.linspace(0, len(places) - 1, min(count, len(places))).round().astype(int)
        return [int(place) for place in places[picked]]

    def picture(self, log: PhaseLog, name: str, draw: Callable[[], bytes], caption: str) -> None:
        """Attach a picture, unless nobody wants any."""
        if self.draws:
            log.attach(name, MEDIA_TYPE, draw(), caption)

    def status(self) -> dict[str, Any]:
        """The board's status registers. Raises `BoardError` if it does not answer several times over."""
        self.was_measured = True
        return _read(self.wire, lambda: read_status(self.address))

    def faulty(self) -> NDArray[np.bool_]:
        """Taxels that a fault found so far explains, bool[taxels]; faults of the whole board explain none."""
        marked = np.zeros(self.kind.taxel_count, dtype=bool)
        for fault in (*self.evidence.at_rest, *(self.evidence.pressed or ())):
            taxels = taxels_of(self.kind, fault.place)
            marked |= taxels & (not taxels.all())
        return marked


def open_station(wire: BoardWire, address: int, hand: Hand | None) -> Station:
    """Ask the board who it is. The probe is `NoProbe` until one is given. Raises `BoardError`."""
    try:
        identity = _read(wire, lambda: read_identity(address))
    except NackError:
        raise BoardError(address, "does not answer; taxel scan shows who does") from None
    if identity is None:
        raise BoardError(address, "runs no application of ours: taxel scan shows what it is, taxel flash gives it one")
    settings = unpack(ScanSettings, _read(wire, lambda: _settings(address)))[0]
    kind = kind_of(address, identity, hand)
    readout = readout_of(wire, address, kind.taxel_count)
    return Station(wire, address, kind, hand, identity, settings, readout, NoProbe())


def _settings(address: int) -> Procedure[bytes]:
    return (yield Transfer(address, bytes([REGISTER_SETTINGS]), packer_of(ScanSettings).size))


def _read(wire: BoardWire, steps: Callable[[], Procedure[T]]) -> T:
    """Registers, asked for several times where a transfer fails: a bus that loses some is to be measured, not met."""
    for _ in range(ATTEMPTS - 1):
        with suppress(TransferError):
            return run(wire, steps())
    return run(wire, steps())


def kind_of(address: int, identity: dict[str, Any], hand: Hand | None) -> BoardKind:
    """The board's design as it says itself; named as the hand description names that kind. Raises `BoardError`."""
    rows, columns = identity["rows"], identity["columns"]
    bits = np.unpackbits(np.frombuffer(identity["crossing_map"], dtype=np.uint8), bitorder="little")
    code = int(identity["kind"])
    named = {board.kind.code: board.kind for board in hand.boards} if hand else {}
    try:
        crossings = bits[: rows * columns].reshape(rows, columns).astype(bool)
        surface = named[code].surface if code in named and named[code].taxel_count == crossings.sum() else None
        return BoardKind(named[code].name if code in named else f"kind {code}", code, crossings, surface)
    except ValueError as error:
        raise BoardError(address, f"its identity contradicts itself ({error}); flash it anew") from None
