"""Board under test: the context of the phases, with the board's connection, identity, probe and detected faults."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

import numpy as np

from taxel.hand import BoardKind, Hand
from taxel.stream.fault_record import FaultRecord
from taxel.types import BoolArray
from taxel_protocol.layout import get_packer, unpack
from taxel_protocol.limits import REGISTER_SETTINGS
from taxel_protocol.registers import ScanSettings
from taxel_tools.application import read_fault, read_identity, read_status
from taxel_tools.bench.analysis.fault import Fault
from taxel_tools.bench.analysis.merging import find_taxels
from taxel_tools.bench.analysis.noise import NoiseParts
from taxel_tools.bench.capture import Capture
from taxel_tools.bench.pictures import MEDIA_TYPE
from taxel_tools.bench.probe import NoProbe, Probe
from taxel_tools.bench.readout import Readout, open_readout
from taxel_tools.errors import BoardError, NackError, TransferError
from taxel_tools.procedure import Procedure, Transfer
from taxel_tools.scheduler import run
from taxel_tools.testing.log import PhaseLog
from taxel_tools.wires import BoardWire

ATTEMPTS: Final = 8

T = TypeVar("T")


@dataclass
class Evidence:
    """Faults that the phases have detected.

    `at_rest`: from the untouched board. `response`: from indentations; None until taxels are indented. `board`: faults
    of the whole board that need no merging.
    """

    at_rest: list[Fault] = field(default_factory=list)
    response: list[Fault] | None = None
    board: list[Fault] = field(default_factory=list)


@dataclass
class BoardUnderTest:
    """One board under test, the context of the phases.

    `rest_record_s`: duration of the record of the untouched board that the phases share. `draws_pictures`: whether
    phases draw pictures. `was_measured`: whether a phase has read the board.
    """

    wire: BoardWire
    address: int
    kind: BoardKind
    hand: Hand | None
    identity: dict[str, Any]
    settings: dict[str, int]
    readout: Readout
    probe: Probe
    rest_record_s: float = 1.0
    evidence: Evidence = field(default_factory=Evidence)
    noise: NoiseParts | None = None
    draws_pictures: bool = True
    was_measured: bool = False
    _rest_record: Capture | None = None

    @property
    def full_scale_count(self) -> float:
        """Largest count of a conversion with the scan settings of the board (protocol/SPEC.md)."""
        return float(self.settings["sub_conversions"] * self.settings["sense_clock_divider"])

    def read_at_rest(self, seconds: float, log: PhaseLog | None = None) -> Capture:
        """Return a record of the untouched board of about `seconds` or longer. Raises `BoardError`.

        The record is shared by the phases: it is read once, and again only for a phase that needs a longer one. log:
        receives the progress.
        """
        self.rest_record_s = max(self.rest_record_s, seconds)
        # The time from the first scan to the last is somewhat shorter than the requested duration.
        if self._rest_record is None or self._rest_record.seconds < 0.9 * seconds:
            self._rest_record = self.read_for(self.rest_record_s, log)
        return self._rest_record

    def read_for(self, seconds: float, log: PhaseLog | None = None) -> Capture:
        """Read the frames of the next `seconds` seconds, at least two.

        Raises `BoardError`. log: receives the progress.
        """

        def is_enough(count: int, elapsed: float) -> bool:
            """Return whether the time has elapsed and at least two frames have arrived; report the progress."""
            if log is not None:
                log.report_progress(elapsed / seconds)
            return elapsed >= seconds and count > 1

        return self._read_until(is_enough)

    def read_frames(self, count: int, skip: int = 0) -> Capture:
        """Read the next `count` frames, after `skip` discarded frames. Raises `BoardError`."""
        if skip:
            self._read_until(lambda frames, elapsed: frames >= skip)
        return self._read_until(lambda frames, elapsed: frames >= count)

    def _read_until(self, is_enough: Callable[[int, float], bool]) -> Capture:
        """Read frames of the board until `is_enough(number of frames, elapsed seconds)` returns True."""
        self.was_measured = True
        return self.readout.read_frames(is_enough)

    def select_inner_taxels(self, count: int) -> list[int]:
        """Select `count` healthy taxels spread over the board, with neighbours on all sides if there are such taxels.

        Returns their indices; fewer if the board has fewer such taxels.
        """
        # The border shifts the indices by 1: offset 1 is the taxel itself, 0 and 2 are its neighbours.
        has_taxel = np.pad(self.kind.crossings, 1)
        is_inner = ~self.find_faulty_taxels()
        for row in (0, 1, 2):
            for column in (0, 1, 2):
                is_inner &= has_taxel[self.kind.tx.astype(int) + row, self.kind.rx.astype(int) + column]
        candidates = np.nonzero(is_inner)[0] if is_inner.any() else np.arange(self.kind.taxel_count)
        positions = np.linspace(0, len(candidates) - 1, min(count, len(candidates))).round().astype(int)
        return [int(taxel) for taxel in candidates[positions]]

    def attach_picture(self, log: PhaseLog, name: str, draw: Callable[[], bytes], caption: str) -> None:
        """Attach a picture to the log of a phase if pictures are enabled.

        draw: function that returns the bytes of the picture; it is not called if pictures are disabled.
        """
        if self.draws_pictures:
            log.attach(name, MEDIA_TYPE, draw(), caption)

    def read_status(self) -> dict[str, Any]:
        """Read the status registers of the board. Raises `BoardError` after several reads without an answer."""
        self.was_measured = True
        return _read_registers(self.wire, lambda: read_status(self.address))

    def read_fault(self) -> FaultRecord | None:
        """Read the last fault of the board since power-on; None if there was none.

        Raises `BoardError` as `read_status`.
        """
        return _read_registers(self.wire, lambda: read_fault(self.address, self.identity))

    def find_faulty_taxels(self) -> BoolArray:
        """Return the taxels that a detected fault of a taxel or a line concerns, bool[taxels].

        Faults of the whole board are ignored.
        """
        mask = np.zeros(self.kind.taxel_count, dtype=bool)
        for fault in (*self.evidence.at_rest, *(self.evidence.response or ())):
            taxels = find_taxels(self.kind, fault.place)
            mask |= taxels & (not taxels.all())
        return mask


def open_board(wire: BoardWire, address: int, hand: Hand | None) -> BoardUnderTest:
    """Read identity and settings of a board, and return its test context with the probe `NoProbe`.

    Raises `BoardError` if the board does not answer or runs no taxel application.
    """
    try:
        identity = _read_registers(wire, lambda: read_identity(address))
    except NackError:
        raise BoardError(address, "does not answer; run taxel scan to list the boards") from None
    if identity is None:
        raise BoardError(address, "runs no taxel application; identify it with taxel scan, then use taxel flash")
    settings = unpack(ScanSettings, _read_registers(wire, lambda: _read_settings(address)))[0]
    kind = build_kind(address, identity, hand)
    readout = open_readout(wire, address, kind.taxel_count)
    return BoardUnderTest(wire, address, kind, hand, identity, settings, readout, NoProbe())


def _read_settings(address: int) -> Procedure[bytes]:
    """Read the scan settings of a board."""
    return (yield Transfer(address, bytes([REGISTER_SETTINGS]), get_packer(ScanSettings).size))


def _read_registers(wire: BoardWire, build_procedure: Callable[[], Procedure[T]]) -> T:
    """Read registers of a board, and repeat the read if a transfer fails, because a test must also measure a faulty
    bus.

    build_procedure: makes the transfers of one attempt. The error of the last of `ATTEMPTS` attempts is raised.
    """
    for _ in range(ATTEMPTS - 1):
        with suppress(TransferError):
            return run(wire, build_procedure())
    return run(wire, build_procedure())


def build_kind(address: int, identity: dict[str, Any], hand: Hand | None) -> BoardKind:
    """Build the board kind from the identity registers, with the name that the hand description gives this kind code.

    Without a name there, the kind is called "kind CODE". Raises `BoardError` if the registers contradict each other.
    """
    rows, columns = identity["rows"], identity["columns"]
    bits = np.unpackbits(np.frombuffer(identity["crossing_map"], dtype=np.uint8), bitorder="little")
    code = int(identity["kind"])
    hand_kinds = {board.kind.code: board.kind for board in hand.boards} if hand else {}
    try:
        crossings = bits[: rows * columns].reshape(rows, columns).astype(bool)
        hand_kind = hand_kinds.get(code)
        surface = hand_kind.surface if hand_kind and hand_kind.taxel_count == crossings.sum() else None
        return BoardKind(hand_kind.name if hand_kind else f"kind {code}", code, crossings, surface)
    except ValueError as error:
        raise BoardError(
            address, f"the identity is inconsistent ({error}); write the firmware again with taxel flash"
        ) from None
