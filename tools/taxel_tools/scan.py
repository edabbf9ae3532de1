"""Bus scan: applications with version and health, bootloaders, addresses that several boards share."""

from dataclasses import dataclass, field
from typing import Any, Final

from taxel.errors import TaxelError
from taxel_protocol.bootloader import BOOT_DEFAULT_ADDRESS, BOOT_PACKET_START, BOOT_SLOT_NONE, BootStay
from taxel_protocol.bootloader_packets import parse_packet
from taxel_protocol.layout import unpack
from taxel_protocol.limits import REGISTER_IDENTITY, WHO_AM_I
from taxel_protocol.names import BoardErrorFlag, ResetCause
from taxel_protocol.registers import Identity
from taxel_tools.application import READ_ATTEMPTS, get_firmware_version, is_identity, read_fault, read_status
from taxel_tools.errors import BoardError, TransferError
from taxel_tools.firmware_update import format_version
from taxel_tools.procedure import Clock, Procedure, Transfer
from taxel_tools.scheduler import run_all
from taxel_tools.session import BootInfo, BootSession
from taxel_tools.wires import BoardWire

IDENTITY_SIZE: Final = 58
SHARED: Final = "shared"


@dataclass(frozen=True)
class BusDevice:
    """A device that answers at an address.

    `runs`: `application`, `bootloader`, `shared` (several boards, or a board whose bytes arrive damaged) or `foreign`
    (not a taxel board). `version` is the version of the application; `notes` lists every deviation from a healthy
    board.
    """

    address: int
    runs: str
    kind: int = 0
    version: str = ""
    unique_id: str = ""
    taxels: int = 0
    notes: tuple[str, ...] = ()
    counters: dict[str, int] = field(default_factory=dict)


def scan_bus(wire: BoardWire) -> list[BusDevice]:
    """List every device on the bus, sorted by address.

    Writes only register pointers, and SEARCH packets to bootloaders.
    """
    results = run_all(wire, {address: identify_device(address, wire.now_s) for address in wire.scan()})
    return [
        BusDevice(address, "foreign", notes=(str(result),)) if isinstance(result, TaxelError) else result
        for address, result in sorted(results.items())
    ]


def identify_device(address: int, now_s: Clock) -> Procedure[BusDevice]:
    """Identify the device at an I2C address: a running board, a bootloader, several boards, or a foreign device."""
    data = b"\xff"  # If all transfers fail, the device may be a bootloader, which returns FF bytes.
    has_taxel_signature = False
    for _ in range(READ_ATTEMPTS):
        try:
            data = yield Transfer(address, bytes([REGISTER_IDENTITY]), IDENTITY_SIZE)
        except TransferError:
            continue
        if is_identity(data):
            return (yield from _describe_application(address, unpack(Identity, data)[0]))
        has_taxel_signature = has_taxel_signature or data[0] == WHO_AM_I
    if has_taxel_signature:
        note = "several boards answer, or the wiring is faulty; run taxel provision --search"
        return BusDevice(address, SHARED, notes=(note,))
    if _can_be_bootloader(data, address == BOOT_DEFAULT_ADDRESS):
        return (yield from _identify_bootloader(address, now_s))
    return BusDevice(address, "foreign", notes=("not a taxel board",))


def _can_be_bootloader(data: bytes, can_be_several: bool) -> bool:
    """Return whether an unknown response can come from a bootloader; other devices receive no packets.

    can_be_several: whether several boards may answer at the address. A bootloader returns only FF bytes, or the
    response to an earlier packet. The responses of several boards overlap on the bus: only their first byte is
    reliable.
    """
    if set(data) == {0xFF} or (can_be_several and data[0] == BOOT_PACKET_START):
        return True
    try:
        parse_packet(data)
    except ValueError:
        return False
    return True


def _describe_application(address: int, identity: dict[str, Any]) -> Procedure[BusDevice]:
    """Describe a running board for the scan: identity, counters, and notes on problems."""
    status = yield from read_status(address)
    notes = []
    if identity["address"] != address:
        notes.append(f"reports the address 0x{identity['address']:02X}")
    if address == BOOT_DEFAULT_ADDRESS:
        notes.append("has no configuration; assign one with taxel provision")
    notes += [flag.name.lower().replace("_", " ") for flag in BoardErrorFlag if status["error_flags"] & flag]
    if status["reset_cause"] in (ResetCause.WATCHDOG, ResetCause.BROWN_OUT):
        notes.append(f"last start after a {ResetCause(status['reset_cause']).name.lower().replace('_', '-')}")
    if not status["scans"]:
        notes.append("does not scan")
    fault = yield from read_fault(address, identity)
    notes += [fault.describe()] if fault is not None else []
    counters = ("scans", "scan_time_us", "bus_errors", "rejected_writes", "saturated_conversions")
    return BusDevice(
        address,
        "application",
        identity["kind"],
        format_version(get_firmware_version(identity)),
        identity["unique_id"].hex(),
        identity["taxel_count"],
        tuple(notes),
        {name: status[name] for name in counters},
    )


def _identify_bootloader(address: int, now_s: Clock) -> Procedure[BusDevice]:
    """Describe the bootloader at an address for the scan, by SEARCH and GET_INFO, which need no session.

    Overlapping replies of several boards are detected by their second half, which repeats the id inverted.
    """
    session = BootSession(address, now_s)
    try:
        reply = yield from session.search(0, bytes(8))  # 0 bits of the id: every board replies
        if reply is None:
            return BusDevice(address, "foreign", notes=("not a taxel board",))
        if any(first ^ second != 0xFF for first, second in zip(reply[:8], reply[8:], strict=True)):
            note = "several boards answer; list them with taxel provision --search"
            return BusDevice(address, SHARED, notes=(note,))
        info = yield from session.read_info()
    except BoardError:
        return BusDevice(address, "foreign", notes=("not a taxel board",))
    return BusDevice(address, "bootloader", info.kind, "", info.unique_id.hex(), notes=describe_bootloader(info))


def describe_bootloader(info: BootInfo) -> tuple[str, ...]:
    """Return notes on a bootloader for the user.

    They state why no image runs, whether the configuration is missing, and which image is on trial.
    """
    reasons = {
        BootStay.LISTENING: "waits for a host",
        BootStay.REQUESTED: "entered on request of the application",
        BootStay.NO_IMAGE: "no startable image; flash the board",
        BootStay.HOST: "kept active by a host",
    }
    notes = [reasons.get(BootStay(info.stay), "") if info.stay in BootStay._value2member_map_ else f"stay {info.stay}"]
    if info.address == BOOT_DEFAULT_ADDRESS:
        notes.append("no configuration; provision the board")
    if info.pending != BOOT_SLOT_NONE:
        notes.append(f"slot {'AB'[info.pending & 1]} on trial, {info.tries[info.pending & 1]} boot attempts left")
    return tuple(note for note in notes if note)
