"""Configuration of boards: address, kind, serial number, calibration.

Boards that share an address are restarted into their bootloaders, identified by unique id (SEARCH), selected one at a
time, configured and restarted; the restart moves each board to its own address.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

from taxel.errors import TaxelError
from taxel_protocol.bootloader import BOOT_DEFAULT_ADDRESS, BOOT_VERSION
from taxel_protocol.bootloader_packets import find_unique_ids
from taxel_tools.application import request_bootloader
from taxel_tools.errors import BoardError, TransferError
from taxel_tools.procedure import Pause, Procedure, Transfer
from taxel_tools.provisioning_plan import IDAC_COUNT, SERIAL_SIZE, Entry
from taxel_tools.scheduler import run
from taxel_tools.session import BootSession
from taxel_tools.wires import BoardWire

UNIQUE_ID_BITS: Final = 64
SLOTS: Final = (0, 1)
RESTART_S: Final = 0.15
"""Time from a restart until the bootloader answers at its address."""
ENTER_ATTEMPTS: Final = 3


@dataclass(frozen=True)
class Candidate:
    """A board in its bootloader: I2C address, unique id, and the fields of its `Configuration` (None without one)."""

    address: int
    unique_id: bytes
    configuration: dict[str, Any] | None


@dataclass(frozen=True)
class Change:
    """A configuration to be written, and the board that receives it."""

    candidate: Candidate
    configuration: dict[str, Any]

    @property
    def address(self) -> int:
        """Address of the board after the change."""
        return int(self.configuration["address"])


def provision(
    wire: BoardWire,
    addresses: Sequence[int],
    entries: Sequence[Entry],
    on_change: Callable[[Change], None] = lambda change: None,
    write: bool = True,
) -> tuple[list[Candidate], list[Change]]:
    """Configure the boards at `addresses` as `entries` state; returns the boards found and the changes.

    `on_change` is called before each change; with `write` False nothing is written. An interrupted run is completed by
    running the command again. Boards without an entry are restarted unchanged. Raises `BoardError`.
    """
    in_use = wire.scan()
    candidates = collect_boards(wire, addresses, entries)
    try:
        changes = plan_changes(candidates, entries, in_use)
        for change in changes:
            on_change(change)
        if write:
            write_changes(wire, changes)
    except TaxelError:
        with suppress(TaxelError):
            release_boards(wire, candidates)
        raise
    changed = {change.candidate.unique_id for change in changes} if write else set()
    release_boards(wire, [board for board in candidates if board.unique_id not in changed])
    return candidates, changes


def enter_bootloaders(wire: BoardWire, address: int) -> None:
    """Restart every board at an I2C address into its bootloader. Boards in their bootloader stay there."""
    run(wire, _request_bootloader(address))


def _request_bootloader(address: int) -> Procedure[None]:
    """Restart the board at an address into its bootloader. Raises `BoardError` if no board answers.

    A generator of I2C transfers and pauses (`Procedure`).
    """
    for _ in range(ENTER_ATTEMPTS):
        try:
            yield from request_bootloader(address)
        except TransferError:
            yield Pause(0.02)
            continue
        yield Pause(RESTART_S)
        return
    raise BoardError(address, "no board answers at this address; check power and address")


def find_boards(wire: BoardWire, address: int = BOOT_DEFAULT_ADDRESS) -> list[Candidate]:
    """Find every board in its bootloader at `address`, sorted by unique id; afterwards all of them respond again.

    Writes nothing. Raises `BoardError` if the replies contradict each other, as on faulty wiring.
    """
    session = BootSession(address, wire.now_s)
    try:
        ids = find_unique_ids(lambda bits, prefix: run(wire, session.search(bits, prefix)))
        boards = [
            Candidate(address, unique_id, _read_configuration(wire, session, unique_id)) for unique_id in sorted(ids)
        ]
        if boards:
            # A search deselects the boards that do not match; a search for 0 bits of the id selects all boards again.
            run(wire, session.search(0, bytes(8)))
    except ValueError as error:
        problem = f"the replies of the boards contradict each other ({error}); check the wiring"
        raise BoardError(address, problem) from None
    return boards


def collect_boards(wire: BoardWire, addresses: Sequence[int], entries: Sequence[Entry]) -> list[Candidate]:
    """Restart the boards at `addresses` into their bootloaders, and return them with boards that have already moved.

    An earlier run may have been interrupted after some boards received their new addresses. A board whose entry names a
    unique id is therefore also searched at its new address. Raises `BoardError` if no board answers at an address and
    no board has moved.
    """
    boards: list[Candidate] = []
    first_error: BoardError | None = None
    for address in addresses:
        try:
            enter_bootloaders(wire, address)
        except BoardError as error:
            first_error = first_error or error
            continue
        boards += find_boards(wire, address)
    moved = [board for entry in entries for board in _find_moved_board(wire, entry, boards)]
    if first_error is not None and not moved:
        release_boards(wire, boards)
        raise first_error
    return boards + moved


def _find_moved_board(wire: BoardWire, entry: Entry, boards: Sequence[Candidate]) -> list[Candidate]:
    """Return the board of an entry, in its bootloader, if it already answers at its new address; otherwise [].

    boards: boards found at their old addresses. Other boards at the new address are restarted.
    """
    is_at_old_address = any(board.unique_id == entry.unique_id for board in boards)
    if (
        entry.unique_id is None
        or entry.address is None
        or is_at_old_address
        or not _is_acknowledged(wire, entry.address)
    ):
        return []
    enter_bootloaders(wire, entry.address)
    boards = find_boards(wire, entry.address)
    release_boards(wire, [board for board in boards if board.unique_id != entry.unique_id])
    return [board for board in boards if board.unique_id == entry.unique_id]


def _is_acknowledged(wire: BoardWire, address: int) -> bool:
    """Return whether a device acknowledges the I2C address."""

    def probe() -> Procedure[bool]:
        """Send only the address; return whether it was acknowledged."""
        try:
            yield Transfer(address)
        except TransferError:
            return False
        return True

    return run(wire, probe())


def _select_board(wire: BoardWire, session: BootSession, unique_id: bytes) -> None:
    """Make only the board with this unique id listen to the session at a shared address. Raises `BoardError`."""
    if run(wire, session.search(UNIQUE_ID_BITS, unique_id)) is None:
        raise BoardError(session.address, f"the board with id {unique_id.hex()} does not answer any more; search again")


def _read_configuration(wire: BoardWire, session: BootSession, unique_id: bytes) -> dict[str, Any] | None:
    """Read the configuration of the board with this unique id from its bootloader; None if it has none.

    session: session at the address, which several boards may share.
    """
    _select_board(wire, session, unique_id)
    return run(wire, session.read_configuration())


def plan_changes(candidates: Sequence[Candidate], entries: Sequence[Entry], in_use: Sequence[int]) -> list[Change]:
    """Plan the configurations to be written. candidates: boards found; entries: requested values.

    in_use: addresses where other boards answer. Raises `BoardError` for a board that was not found, a board without
    an address, and an address in use.
    """
    changes: list[Change] = []
    for entry in entries:
        candidate = _select_candidate(entry, candidates)
        change = Change(candidate, _merge_configuration(candidate, entry))
        changes.append(change)
    moving_ids = {change.candidate.unique_id for change in changes}
    kept_addresses = {
        c.configuration["address"] for c in candidates if c.configuration and c.unique_id not in moving_ids
    }
    for i, change in enumerate(changes):
        assigned = {earlier.address for earlier in changes[:i]} | kept_addresses
        is_in_use = change.address in in_use and change.address != change.candidate.address
        if is_in_use or change.address in assigned:
            raise BoardError(
                change.address,
                f"the address is in use already, so the board with id {change.candidate.unique_id.hex()} cannot get "
                "this address; choose a free address",
            )
    return changes


def _select_candidate(entry: Entry, candidates: Sequence[Candidate]) -> Candidate:
    """Return the board that an entry selects by unique id; without a unique id, the only board.

    Raises `BoardError` if this board was not found, or if an entry without a unique id meets none or several boards.
    """
    ids = ", ".join(candidate.unique_id.hex() for candidate in candidates)
    if entry.unique_id is None:
        if len(candidates) == 1:
            return candidates[0]
        address = candidates[0].address if candidates else BOOT_DEFAULT_ADDRESS
        problem = f"{len(candidates)} boards answer ({ids})" if candidates else "no board answers at this address"
        remedy = "select one with --id" if candidates else "check power and address"
        raise BoardError(address, f"{problem}; {remedy}")
    for candidate in candidates:
        if candidate.unique_id == entry.unique_id:
            return candidate
    address = candidates[0].address if candidates else BOOT_DEFAULT_ADDRESS
    problem = f"expected the board with id {entry.unique_id.hex()}, found {ids or 'none'}; check the id"
    raise BoardError(address, problem)


def _merge_configuration(candidate: Candidate, entry: Entry) -> dict[str, Any]:
    """Merge the requested values with the old configuration of a board; a requested value takes precedence.

    Returns the fields of `Configuration`. Raises `BoardError` for a board that has no address and receives none.
    """
    old = candidate.configuration or {}
    address = entry.address if entry.address is not None else old.get("address")
    if address is None:
        problem = f"board {candidate.unique_id.hex()} is blank; assign an address with --new-address"
        raise BoardError(candidate.address, problem)
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


def write_changes(wire: BoardWire, changes: Sequence[Change]) -> None:
    """Write the configurations, read each back, and restart the boards. Raises `BoardError`.

    All boards must be in their bootloaders, as after `find_boards`.
    """
    for change in changes:
        session = BootSession(change.candidate.address, wire.now_s)
        unique_id = change.candidate.unique_id
        _select_board(wire, session, unique_id)
        run(wire, session.start_session())
        run(wire, session.write_configuration(unique_id, change.configuration))
        if run(wire, session.read_configuration()) != change.configuration:
            problem = f"board {unique_id.hex()} does not keep its configuration; replace the board"
            raise BoardError(session.address, problem)
        run(wire, _reset_boot_attempts(session))
        run(wire, session.exit())
    # A search for 0 bits of the id selects all boards that stay at the address, so that they respond again.
    for address in {change.candidate.address for change in changes}:
        run(wire, BootSession(address, wire.now_s).search(0, bytes(8)))


def _reset_boot_attempts(session: BootSession) -> Procedure[None]:
    """Restore the boot attempts of a board without a confirmed image, by selecting its image again.

    Without a configuration the image could not confirm itself, and every power-up used one boot attempt. The pending
    image is selected, else the first one; a board without an image stays unchanged.
    """
    info = yield from session.read_info()
    if info.confirmed in SLOTS:
        return
    for slot in (*(slot for slot in SLOTS if slot == info.pending), *SLOTS):
        if (yield from session.read_metadata(slot)) is not None:
            yield from session.set_active(slot)
            return


def release_boards(wire: BoardWire, candidates: Sequence[Candidate]) -> None:
    """Restart boards that stay unchanged, so that their applications run again. Missing boards are skipped."""
    for candidate in candidates:
        session = BootSession(candidate.address, wire.now_s)
        # A search for the whole id selects this board: the others at the address ignore the next commands.
        if run(wire, session.search(UNIQUE_ID_BITS, candidate.unique_id)) is not None:
            run(wire, session.start_session())
            run(wire, session.exit())
