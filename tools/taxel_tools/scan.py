"""What is on a bus: applications with version and health, bootloaders, addresses that several boards share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

from taxel.errors import TaxelError
from taxel_protocol.bootloader import BOOT_DEFAULT_ADDRESS, BOOT_PACKET_START, BOOT_SLOT_NONE, BootStay, parse_packet
from taxel_protocol.layout import unpack
from taxel_protocol.limits import REGISTER_IDENTITY, WHO_AM_I
from taxel_protocol.names import BoardErrorFlag, ResetCause
from taxel_protocol.registers import Identity
from taxel_tools.application import READ_ATTEMPTS, is_identity, read_status, version_of
from taxel_tools.errors import BoardError, TransferError
from taxel_tools.interleave import run_all
from taxel_tools.program import dotted
from taxel_tools.session import BootInfo, BootSession
from taxel_tools.steps import Clock, Steps, Transfer
from taxel_tools.wires import BoardWire

IDENTITY_SIZE: Final = 58
SHARED: Final = "shared"


@dataclass(frozen=True)
class Found:
    """What answers at an address.

    `runs`: `application`, `bootloader`, `shared` (several boards, or one whose bytes arrive damaged) or `foreign` (no
    board of ours). `version` is that of the application, `notes` is what is not as it should be.
    """

    address: int
    runs: str
    kind: int = 0
    version: str = ""
    unique_id: str = ""
    taxels: int = 0
    notes: tuple[str, ...] = ()
    counters: dict[str, int] = field(default_factory=dict)


def scan(wire: BoardWire) -> list[Found]:
    """Everything on the bus, by address. Writes nothing but register pointers, and to a bootloader a question."""
    results = run_all(wire, {address: look(address, wire.now_s) for address in wire.scan()})
    return [
        Found(address, "foreign", notes=(str(result),)) if isinstance(result, TaxelError) else result
        for address, result in sorted(results.items())
    ]


def look(address: int, now_s: Clock) -> Steps[Found]:
    """What answers at one address."""
    data = b"\xff"
    looks_like_ours = False
    for _ in range(READ_ATTEMPTS):
        try:
            data = yield Transfer(address, bytes([REGISTER_IDENTITY]), IDENTITY_SIZE)
        except TransferError:
            continue
        if is_identity(data):
            return (yield from _application(address, unpack(Identity, data)[0]))
        looks_like_ours = looks_like_ours or data[0] == WHO_AM_I
    if looks_like_ours:
        note = "several boards answer, or the wire is bad: see taxel provision --search"
        return Found(address, SHARED, notes=(note,))
    if _may_be_bootloader(data, address == BOOT_DEFAULT_ADDRESS):
        return (yield from _bootloader(address, now_s))
    return Found(address, "foreign", notes=("no board of ours",))


def _may_be_bootloader(data: bytes, may_be_several: bool) -> bool:
    """Nothing but FF, or a response that is left from before: other devices are not sent packets.

    Responses of several boards lie over one another: of them only the first byte is sure.
    """
    if set(data) == {0xFF} or (may_be_several and data[0] == BOOT_PACKET_START):
        return True
    try:
        parse_packet(data)
    except ValueError:
        return False
    return True


def _application(address: int, identity: dict[str, Any]) -> Steps[Found]:
    status = yield from read_status(address)
    notes = []
    if identity["address"] != address:
        notes.append(f"says that its address is 0x{identity['address']:02X}")
    if address == BOOT_DEFAULT_ADDRESS:
        notes.append("has no configuration: taxel provision gives it one")
    notes += [flag.name.lower().replace("_", " ") for flag in BoardErrorFlag if status["error_flags"] & flag]
    if status["reset_cause"] in (ResetCause.WATCHDOG, ResetCause.BROWN_OUT):
        notes.append(f"last start after a {ResetCause(status['reset_cause']).name.lower().replace('_', '-')}")
    if not status["scans"]:
        notes.append("does not scan")
    counters = ("scans", "scan_time_us", "bus_errors", "rejected_writes", "saturated_conversions")
    return Found(
        address,
        "application",
        identity["kind"],
        dotted(version_of(identity)),
        identity["unique_id"].hex(),
        identity["taxel_count"],
        tuple(notes),
        {name: status[name] for name in counters},
    )


def _bootloader(address: int, now_s: Clock) -> Steps[Found]:
    """GET_INFO and SEARCH may be asked before a session; several boards give answers that lie over one another."""
    session = BootSession(address, now_s)
    try:
        reply = yield from session.search(0, bytes(8))
        if reply is None:
            return Found(address, "foreign", notes=("no board of ours",))
        if any(one ^ other != 0xFF for one, other in zip(reply[:8], reply[8:], strict=True)):
            note = "several boards answer: taxel provision --search lists them"
            return Found(address, SHARED, notes=(note,))
        info = yield from session.info()
    except BoardError:
        return Found(address, "foreign", notes=("no board of ours",))
    return Found(address, "bootloader", info.kind, "", info.unique_id.hex(), notes=describe(info))


def describe(info: BootInfo) -> tuple[str, ...]:
    """Notes on a bootloader: why no image runs, which slot is confirmed, what is on trial."""
    reasons = {
        BootStay.LISTENING: "waits for a host",
        BootStay.REQUESTED: "asked for by the application",
        BootStay.NO_IMAGE: "no image that can start: flash it",
        BootStay.HOST: "held by a host",
    }
    notes = [reasons.get(BootStay(info.stay), "") if info.stay in BootStay._value2member_map_ else f"stay {info.stay}"]
    if info.address == BOOT_DEFAULT_ADDRESS:
        notes.append("no configuration: provision it")
    if info.pending != BOOT_SLOT_NONE:
        notes.append(f"slot {'AB'[info.pending & 1]} on trial, {info.tries[info.pending & 1]} tries left")
    return tuple(note for note in notes if note)
