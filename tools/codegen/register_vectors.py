"""Content of registers.json: register blocks of a board, fields and bytes."""

import random
from collections.abc import Mapping, Sequence
from typing import Any

from construct import Struct
from field_values import SEED, compute_board_crc, fill_fields, nest_values, to_json_values

from taxel_protocol import limits, registers
from taxel_protocol.framing import crc32
from taxel_protocol.layout import list_fields
from taxel_protocol.names import BoardCommand, FaultCode

REGISTERS: dict[str, Struct] = {
    "identity": registers.Identity,
    "status": registers.Status,
    "settings_register": registers.SettingsRegister,
    "command_register": registers.CommandRegister,
    "enter_bootloader_register": registers.EnterBootloaderRegister,
    "fault_register": registers.FaultRegister,
    "snapshot_header": registers.SnapshotHeader,
    "compact_packed": registers.CompactPacked,
    "compact_delta": registers.CompactDelta,
    "compact_acknowledge": registers.CompactAcknowledge,
}


def build_register_vector(name: str, struct: str, start: int, values: Mapping[str, Any]) -> dict[str, Any]:
    """Build the test vector of a struct in a board's register map: its fields, and its bytes as hexadecimal digits.

    struct: name in `REGISTERS`. start: number of the first register. values: by field name.
    """
    definition = REGISTERS[struct]
    data = definition.build(nest_values(definition, values))
    shown = to_json_values(list_fields(definition), values)
    return {"name": name, "struct": struct, "register": start, "fields": shown, "bytes": data.hex()}


def _build_identity(name: str, values: dict[str, Any]) -> dict[str, Any]:
    """Build the test vector of a board's identity registers; the CRC is computed from the other field values."""
    without_crc = registers.Identity.build(nest_values(registers.Identity, values | {"crc32": 0}))[:-4]
    return build_register_vector(name, "identity", limits.REGISTER_IDENTITY, values | {"crc32": crc32(without_crc)})


def _build_settings(name: str, address: int, numbers: Sequence[int]) -> dict[str, Any]:
    """Build the test vector of a board's settings registers; the CRC is computed.

    address: I2C address of the board, which is part of the CRC. numbers: values of all fields except the CRC, in order.
    """
    fields = [field.name for field in list_fields(registers.SettingsRegister)][:-1]
    values = dict(zip(fields, numbers, strict=True))
    without_crc = registers.SettingsRegister.build(nest_values(registers.SettingsRegister, values | {"crc32": 0}))[:-4]
    values["crc32"] = compute_board_crc(address, without_crc)
    vector = build_register_vector(name, "settings_register", limits.REGISTER_SETTINGS, values)
    return vector | {"address": address}


def _build_snapshot(name: str, address: int, header: tuple[int, int], counts: Sequence[int]) -> dict[str, Any]:
    """Build the test vector of a board's snapshot registers; the CRC is computed.

    header: scan number and board time in microseconds. counts: raw counts.
    """
    flat: dict[str, Any] = {"header_sequence": header[0], "header_timestamp_us": header[1]}
    flat |= {"raw_counts": list(counts), "crc32": 0}
    definition = registers.snapshot(len(counts))
    flat["crc32"] = compute_board_crc(address, definition.build(nest_values(definition, flat))[:-4])
    return {
        "name": name,
        "struct": "snapshot_header",
        "register": limits.REGISTER_SNAPSHOT,
        "address": address,
        "fields": {"sequence": header[0], "timestamp_us": header[1]},
        "counts": list(counts),
        "crc32": flat["crc32"],
        "bytes": definition.build(nest_values(definition, flat)).hex(),
    }


def _build_compact() -> list[dict[str, Any]]:
    """Build the test vectors of the registers for compact snapshots, with random field values."""
    rng = random.Random(SEED + 1)  # a separate generator: the vectors of version 1 do not change
    vectors = []
    for name in ("compact_packed", "compact_delta", "compact_acknowledge"):
        fields = list_fields(REGISTERS[name])
        values = {
            field.name: rng.randbytes(3) if field.is_bytes else rng.getrandbits(8 * field.size) for field in fields
        }
        vectors.append(build_register_vector(name, name, limits.REGISTER_COMPACT, values))
    return vectors


def _build_revision_1(board: dict[str, Any]) -> list[dict[str, Any]]:
    """Build the test vectors that revision 1 of the register map adds: identity, bootloader key, fault records.

    board: field values of the identity of a board of revision 0.
    """
    key = {"command": int(BoardCommand.ENTER_BOOTLOADER), "complement": 0xFF ^ BoardCommand.ENTER_BOOTLOADER}
    key["key"] = limits.BOOTLOADER_KEY
    vectors = [
        _build_identity("identity_revision_1", board | {"map_version": 2, "map_revision": 1}),
        build_register_vector("enter_bootloader", "enter_bootloader_register", limits.REGISTER_COMMAND, key),
    ]
    records = {
        "fault_none": (0, 0, 0, 0, 0),
        "fault_exception": (int(FaultCode.EXCEPTION), 3, 2, 0x00001A2C, 0x00001B47),
        "fault_not_scanning": (int(FaultCode.NOT_SCANNING), 0, 0xFFFF, 0, 0),
    }
    fields = [field.name for field in list_fields(registers.FaultRegister)][:-1]
    for name, numbers in records.items():
        values = dict(zip(fields, numbers, strict=True))
        without_crc = registers.FaultRegister.build(nest_values(registers.FaultRegister, values | {"crc32": 0}))[:-4]
        values["crc32"] = compute_board_crc(board["address"], without_crc)
        vector = build_register_vector(name, "fault_register", limits.REGISTER_FAULT, values)
        vectors.append(vector | {"address": board["address"]})
    return vectors


def build_register_vectors() -> list[dict[str, Any]]:
    """Build all test vectors of registers.json, in the order of the file."""
    rng = random.Random(SEED)
    board: dict[str, Any] = {"map_version": 1, "firmware_major": 1, "firmware_minor": 2, "firmware_patch": 3}
    board |= {
        "kind": 2,
        "address": 0x20,
        "map_revision": 0,
        "unique_id": rng.randbytes(8),
        "rows": 9,
        "columns": 7,
    }
    # 9 x 7 = 63 taxels: a snapshot has 6 bytes of header, 2 bytes per taxel and 4 of CRC; one bit per crossing is set.
    board |= {"taxel_count": 63, "snapshot_size": 136, "crossing_map": b"\xff" * 7 + b"\x7f" + bytes(24)}
    status_fields = list_fields(registers.Status)
    vectors = [
        _build_identity("identity", board),
        _build_identity("identity_zeros", fill_fields(list_fields(registers.Identity), lambda field: 0, False)),
        build_register_vector("status_zeros", "status", 0x40, fill_fields(status_fields, lambda field: 0, False)),
        build_register_vector(
            "status", "status", 0x40, fill_fields(status_fields, lambda f: rng.getrandbits(8 * f.size), False)
        ),
        _build_settings("settings", 0x20, (100, 40, 1, 96, 240)),
        _build_settings("settings_of_another_board", 0x21, (100, 40, 1, 96, 240)),
        _build_settings("settings_largest", 0x77, (0xFFFF, 0xFFFF, 0xFF, 0xFF, 0xFFFF)),
    ]
    for command in BoardCommand:
        values = {"command": int(command), "complement": 0xFF ^ command}
        vectors.append(build_register_vector(f"command_{command.name.lower()}", "command_register", 0x70, values))
    counts = [rng.getrandbits(16) for _ in range(limits.TAXELS_MAX)]
    return [
        *vectors,
        _build_snapshot("snapshot_shortest", 0x08, (0, 0), [0]),
        _build_snapshot("snapshot", 0x20, (1234, 56_789_012), counts[:63]),
        _build_snapshot("snapshot_of_another_board", 0x21, (1234, 56_789_012), counts[:63]),
        _build_snapshot("snapshot_longest", 0x77, (0xFFFF, 0xFFFFFFFF), counts),
        *_build_compact(),
        *_build_revision_1(board),
    ]
