"""Writer for the bootloader of the original boards (the manufacturer's Bootloader_v1_60 on I2C).

The bootloader has one application, which it erases with the first row that is written, and checks the application only
by an 8-bit sum. Every response is read before the next packet is sent, because it waits for the read. Nothing here has
been verified on hardware.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from taxel_protocol.bootloader import BOOT_ROW_SIZE, BootCommand, BootStatus, RowAddress
from taxel_protocol.bootloader_packets import compute_row_sum
from taxel_protocol.layout import pack
from taxel_tools.errors import BoardError, LostError, StatusError, TransferError
from taxel_tools.procedure import Clock, Pause, Procedure
from taxel_tools.session import CHUNK_SIZE, BootSession

ROW_ATTEMPTS: Final = 4
WAIT_S: Final = 60.0
"""Time in s for which a writer waits for a board that is switched on; the bootloader listens for 0.5 s."""

WAIT_PAUSE_S: Final = 0.02
REPEATABLE: Final = {BootStatus.LENGTH, BootStatus.DATA, BootStatus.CHECKSUM}
"""Refusals that a damaged or repeated packet causes: the row is sent again."""

FAMILY_PSOC4200: Final = 0x1193
"""Lower half of the silicon ids of the PSoC 4200 family."""

ROWS_ORIGINAL: Final = 128
"""Flash rows of a CY8C4244AZI-443: 16 KiB."""


@dataclass(frozen=True)
class OriginalInfo:
    """Report of the bootloader of an original board.

    silicon_id, revision: identity of the part. version: version of the bootloader, 3 bytes. last_row: last row of the
    flash.
    """

    silicon_id: int
    revision: int
    version: bytes
    first_row: int
    """First row that is not a part of the bootloader."""
    last_row: int
    has_application: bool


def start_original_session(session: BootSession, wait_s: float = WAIT_S) -> Procedure[OriginalInfo]:
    """Wait until the bootloader of an original board answers, and read what it reports.

    Raises BoardError after `wait_s` seconds, StatusError if the bootloader refuses.
    """
    deadline = session.now_s() + wait_s
    while True:
        try:
            entered = yield from session.start_session(attempts=1)
            break
        except (TransferError, BoardError) as error:
            if isinstance(error, StatusError):
                raise
            if session.now_s() > deadline:
                problem = f"no bootloader answers within {wait_s:g} s; switch the board off and on while waiting"
                raise BoardError(session.address, problem) from None
        yield Pause(WAIT_PAUSE_S)
    first, last = yield from session.read_free_rows()
    status = yield from session.request(BootCommand.GET_APPLICATION_STATUS, b"\0", 2)
    return OriginalInfo(
        entered["silicon_id"], entered["revision"], bytes(entered["bootloader_version"]), first, last, status[0] == 0
    )


def check_original_file(address: int, info: OriginalInfo, silicon_id: int, rows: Mapping[int, bytes]) -> None:
    """Check that the rows of a file fit the part that answered, before anything is written.

    silicon_id, rows: identity of the part and flash rows by number, from the file. Raises `BoardError`.
    """
    if info.silicon_id & 0xFFFF != FAMILY_PSOC4200:
        raise BoardError(address, f"silicon id {info.silicon_id:08X} is not of a PSoC 4200; nothing was written")
    if info.silicon_id != silicon_id:
        problem = f"the file is for silicon id {silicon_id:08X}, the board reports {info.silicon_id:08X}"
        raise BoardError(address, f"{problem}; nothing was written")
    if info.last_row != ROWS_ORIGINAL - 1:
        problem = f"expected {ROWS_ORIGINAL} flash rows, the board reports {info.last_row + 1}"
        raise BoardError(address, f"{problem}; nothing was written")
    if min(rows) < info.first_row or max(rows) != info.last_row or info.first_row not in rows:
        problem = f"the file has rows {min(rows)} to {max(rows)}, expected {info.first_row} to {info.last_row}"
        raise BoardError(address, f"{problem}; build it with TAXEL_ORIGINAL_FIRST_ROW={info.first_row}")


def write_original_rows(
    session: BootSession, rows: Mapping[int, bytes], report: Callable[[int, int], None] = lambda done, total: None
) -> Procedure[None]:
    """Write all rows, the metadata row last, let the bootloader verify the application, and start it.

    report: receives the numbers of written rows and of all rows. Raises `BoardError`; an interrupted update leaves the
    board in its bootloader, where the writer can be run again.
    """
    for done, row in enumerate(sorted(rows), start=1):
        yield from _write_row(session, row, rows[row])
        report(done, len(rows))
    if (yield from session.request(BootCommand.VERIFY_APPLICATION, reply=1)) != b"\x01":
        raise BoardError(session.address, "the bootloader rejects the sum of the application; write it again")
    yield from session.send_without_response(BootCommand.EXIT)


def _write_row(session: BootSession, row: int, data: bytes) -> Procedure[None]:
    """Write one row and compare its sum.

    After a damaged or lost packet the row is sent again; after `ROW_ATTEMPTS` attempts, `BoardError` is raised.
    """
    assert len(data) == BOOT_ROW_SIZE
    for attempt in range(ROW_ATTEMPTS):
        try:
            if attempt:
                yield from session.send_without_response(BootCommand.SYNC)
            yield from _send_row(session, row, data)
            if (yield from session.read_row_sum(row)) == compute_row_sum(data):
                return
        except (StatusError, LostError) as error:
            if isinstance(error, StatusError) and error.status not in REPEATABLE:
                raise
    raise BoardError(session.address, f"row {row} does not read back as sent; check the wiring and write again")


def _send_row(session: BootSession, row: int, data: bytes) -> Procedure[None]:
    """Send the three packets of a row. A packet is not repeated alone: the bootloader would append its data again."""
    for start in (0, CHUNK_SIZE):
        yield from session.request(BootCommand.SEND_DATA, data[start : start + CHUNK_SIZE], attempts=1)
    address = pack(RowAddress, {"array": 0, "row": row})
    yield from session.request(BootCommand.PROGRAM_ROW, address + data[2 * CHUNK_SIZE :], attempts=1)


def update_original(
    address: int,
    now_s: Clock,
    silicon_id: int,
    rows: Mapping[int, bytes],
    wait_s: float = WAIT_S,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> Procedure[OriginalInfo]:
    """Write the rows of a file to the original board at `address`, and return the report of its bootloader.

    silicon_id, rows: identity of the part and flash rows by number, from the file. report: receives the numbers of
    written rows and of all rows. Raises `BoardError`, `StatusError`.
    """
    session = BootSession(address, now_s)
    info = yield from start_original_session(session, wait_s)
    check_original_file(address, info, silicon_id, rows)
    yield from write_original_rows(session, rows, report)
    return info
