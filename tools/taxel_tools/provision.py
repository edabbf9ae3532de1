"""Give boards who they are: address, kind, serial number, calibration. Boards that share an address are told apart.

All that share it are brought into their bootloaders, found by their unique ids (SEARCH), chosen one at a time,
configured, and restarted, which makes them leave the shared address.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

from taxel.errors import TaxelError
from taxel_protocol.bootloader import BOOT_DEFAULT_ADDRESS, BOOT_VERSION, search_ids
from taxel_protocol.limits import REGISTER_COMMAND
from taxel_protocol.names import BoardCommand
from taxel_tools.errors import BoardError, TransferError
from taxel_tools.interleave import run
from taxel_tools.plan import IDAC_COUNT, SERIAL_SIZE, Entry
from taxel_tools.session import BootSession
from taxel_tools.steps import Pause, Steps, Transfer
from taxel_tools.wires import BoardWire

ALL: Final = 64
SLOTS: Final = (0, 1)
RESTART_S: Final = 0.15
"""From a restart until the bootloader listens at its address."""
ENTER_ATTEMPTS: Final = 3


@dataclass(frozen=True)
class Candidate:
    """A board in its bootloader: where it answers, its id, and the fields of its `Configuration` (None: blank)."""

    address: int
    unique_id: bytes
    configuration: dict[str, Any] | None


@dataclass(frozen=True)
class Change:
    """What will be written to a board: the new configuration beside what it was."""

    candidate: Candidate
    configuration: dict[str, Any]

    @property
    def address(self) -> int:
        """Where the board will answer."""
        return int(self.configuration["address"])


def provision(
    wire: BoardWire,
    places: Sequence[int],
    entries: Sequence[Entry],
    tell: Callable[[Change], None] = lambda change: None,
    write: bool = True,
) -> tuple[list[Candidate], list[Change]]:
    """Carry entries out on the boards at these addresses: who was found, and what was (or would be) written.

    A run that was cut off is completed by running it again. Boards that are not meant are let go. Raises `BoardError`.
    """
    in_use = wire.scan()
    candidates = gather(wire, places, entries)
    try:
        changes = changes_of(candidates, entries, in_use)
        for change in changes:
            tell(change)
        if write:
            apply(wire, changes)
    except TaxelError:
        with suppress(TaxelError):
            release(wire, candidates)
        raise
    changed = {change.candidate.unique_id for change in changes} if write else set()
    release(wire, [one for one in candidates if one.unique_id not in changed])
    return candidates, changes


def open_bootloaders(wire: BoardWire, address: int) -> None:
    """Bring every board at `address` into its bootloader. Those that are there already stay."""
    run(wire, _ask_for_bootloader(address))


def _ask_for_bootloader(address: int) -> Steps[None]:
    command = BoardCommand.ENTER_BOOTLOADER
    for _ in range(ENTER_ATTEMPTS):
        try:
            yield Transfer(address, bytes([REGISTER_COMMAND, command, command ^ 0xFF]))
        except TransferError:
            yield Pause(0.02)
            continue
        yield Pause(RESTART_S)
        return
    raise BoardError(address, "nobody answers there; check power and address")


def find(wire: BoardWire, address: int = BOOT_DEFAULT_ADDRESS) -> list[Candidate]:
    """Every board in its bootloader at `address`, by unique id; afterwards all of them listen again.

    Writes nothing. Raises `BoardError` if the answers contradict each other, as on a bad wire.
    """
    session = BootSession(address, wire.now_s)
    try:
        ids = search_ids(lambda bits, prefix: run(wire, session.search(bits, prefix)))
        found = [Candidate(address, unique_id, _configuration(wire, session, unique_id)) for unique_id in sorted(ids)]
        if found:
            run(wire, session.search(0, bytes(8)))
    except ValueError as error:
        raise BoardError(address, f"the boards there contradict each other ({error}); check the wiring") from None
    return found


def gather(wire: BoardWire, places: Sequence[int], entries: Sequence[Entry]) -> list[Candidate]:
    """Every board at these addresses, in its bootloader, and those of the entries that have left them already.

    An earlier run may have been cut off when some boards had their new addresses: who is named by unique id is looked
    for there too. Raises `BoardError` if nobody answers at an address, and nobody has left it.
    """
    found: list[Candidate] = []
    silent: BoardError | None = None
    for place in places:
        try:
            open_bootloaders(wire, place)
        except BoardError as error:
            silent = silent or error
            continue
        found += find(wire, place)
    moved = [board for entry in entries for board in _moved(wire, entry, found)]
    if silent is not None and not moved:
        release(wire, found)
        raise silent
    return found + moved


def _moved(wire: BoardWire, entry: Entry, found: Sequence[Candidate]) -> list[Candidate]:
    """The entry's board, if it is not among those found, but answers at its new address."""
    is_found = any(board.unique_id == entry.unique_id for board in found)
    if entry.unique_id is None or entry.address is None or is_found or not _answers(wire, entry.address):
        return []
    open_bootloaders(wire, entry.address)
    there = find(wire, entry.address)
    release(wire, [board for board in there if board.unique_id != entry.unique_id])
    return [board for board in there if board.unique_id == entry.unique_id]


def _answers(wire: BoardWire, address: int) -> bool:
    def probe() -> Steps[bool]:
        try:
            yield Transfer(address)
        except TransferError:
            return False
        return True

    return run(wire, probe())


def _choose(wire: BoardWire, session: BootSession, unique_id: bytes) -> None:
    """Let nobody but this board listen."""
    if run(wire, session.search(ALL, unique_id)) is None:
        raise BoardError(session.address, f"the board with id {unique_id.hex()} has gone; search again")


def _configuration(wire: BoardWire, session: BootSession, unique_id: bytes) -> dict[str, Any] | None:
    _choose(wire, session, unique_id)
    return run(wire, session.configuration())


def changes_of(candidates: Sequence[Candidate], entries: Sequence[Entry], in_use: Sequence[int]) -> list[Change]:
    """What the entries ask of the boards that were found. in_use: addresses where other boards answer.

    Raises `BoardError`: a board that was not found, one that stays without an address, an address in use.
    """
    changes: list[Change] = []
    for entry in entries:
        candidate = _candidate_for(entry, candidates)
        change = Change(candidate, _configured(candidate, entry))
        changes.append(change)
    moving = {change.candidate.unique_id for change in changes}
    staying = {c.configuration["address"] for c in candidates if c.configuration and c.unique_id not in moving}
    for place, change in enumerate(changes):
        others = {other.address for other in changes[:place]} | staying
        is_taken = change.address in in_use and change.address != change.candidate.address
        if is_taken or change.address in others:
            raise BoardError(
                change.address,
                f"is in use already, so the board with id {change.candidate.unique_id.hex()} cannot have that address; "
                "choose another one",
            )
    return changes


def _candidate_for(entry: Entry, candidates: Sequence[Candidate]) -> Candidate:
    shown = ", ".join(candidate.unique_id.hex() for candidate in candidates)
    if entry.unique_id is None:
        if len(candidates) == 1:
            return candidates[0]
        where = candidates[0].address if candidates else BOOT_DEFAULT_ADDRESS
        found = f"{len(candidates)} boards answer ({shown}); name one by --id" if candidates else "nobody answers there"
        raise BoardError(where, found)
    for candidate in candidates:
        if candidate.unique_id == entry.unique_id:
            return candidate
    where = candidates[0].address if candidates else BOOT_DEFAULT_ADDRESS
    raise BoardError(where, f"no board with id {entry.unique_id.hex()} answers there; found {shown or 'none'}")


def _configured(candidate: Candidate, entry: Entry) -> dict[str, Any]:
    old = candidate.configuration or {}
    address = entry.address if entry.address is not None else old.get("address")
    if address is None:
        raise BoardError(candidate.address, f"board {candidate.unique_id.hex()} is blank; give it an address")
    serial = old.get("serial_number", bytes(SERIAL_SIZE))
    idac = old.get("idac_codes", bytes(IDAC_COUNT))
    return {
        "version": BOOT_VERSION,
        "address": address,
        "kind": entry.kind if entry.kind is not None else old.get("kind", 0),
        "reserved": 0,
        "serial_number": serial if entry.serial_number is None else entry.serial_number.encode().ljust(16, b"\0"),
        "idac_codes": idac if entry.idac_codes is None else bytes(entry.idac_codes).ljust(IDAC_COUNT, b"\0"),
    }


def apply(wire: BoardWire, changes: Sequence[Change]) -> None:
    """Write the configurations, read each back, and restart the boards. Raises `BoardError`.

    All boards must be in their bootloaders, as `find` leaves them.
    """
    for change in changes:
        session = BootSession(change.candidate.address, wire.now_s)
        unique_id = change.candidate.unique_id
        _choose(wire, session, unique_id)
        run(wire, session.enter_here())
        run(wire, session.write_configuration(unique_id, change.configuration))
        if run(wire, session.configuration()) != change.configuration:
            raise BoardError(session.address, f"board {unique_id.hex()} does not keep its configuration; exchange it")
        run(wire, _renew_tries(session))
        run(wire, session.exit())
    for address in {change.candidate.address for change in changes}:
        run(wire, BootSession(address, wire.now_s).search(0, bytes(8)))  # whoever is left there listens again


def _renew_tries(session: BootSession) -> Steps[None]:
    """Let the image of a board that has confirmed none be tried anew.

    Without a configuration it could not confirm itself, and every power-up has cost one of its tries.
    """
    info = yield from session.info()
    if info.confirmed in SLOTS:
        return
    for slot in (*(one for one in SLOTS if one == info.pending), *SLOTS):
        if (yield from session.metadata(slot)) is not None:
            yield from session.set_active(slot)
            return


def release(wire: BoardWire, candidates: Sequence[Candidate]) -> None:
    """Restart boards that stay as they are, so that their applications run again. Those that have gone are let be."""
    for candidate in candidates:
        session = BootSession(candidate.address, wire.now_s)
        if run(wire, session.search(ALL, candidate.unique_id)) is not None:
            run(wire, session.enter_here())
            run(wire, session.exit())
