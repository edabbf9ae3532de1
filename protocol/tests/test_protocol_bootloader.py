"""Bootloader: encoding and rejection by the definitions, and their agreement with SPEC.md and the C header."""

import random
import re
import subprocess
import sys
from enum import IntEnum
from pathlib import Path

import pytest
from construct import Struct

from taxel_protocol import bootloader as boot
from taxel_protocol.bootloader import BootChecksum, BootCommand, BootDevice
from taxel_protocol.bootloader_images import build_image, build_record
from taxel_protocol.bootloader_packets import (
    build_packet,
    compute_checksum,
    compute_row_sum,
    find_unique_ids,
    parse_packet,
)
from taxel_protocol.framing import crc32
from taxel_protocol.layout import list_fields, pack, unpack

REPOSITORY = Path(__file__).resolve().parents[2]
SPEC = (REPOSITORY / "firmware" / "bootloader" / "SPEC.md").read_text()
SEED = 23
STRUCTS = {name: value for name, value in vars(boot).items() if isinstance(value, Struct)}
ENUMS = {name: value for name, value in vars(boot).items() if isinstance(value, type) and issubclass(value, IntEnum)}
ENUMS.pop("IntEnum", None)


def read_table(mark: str) -> list[list[str]]:
    """Return the cells of the rows of the table that follows `<!-- mark -->` in SPEC.md."""
    _, separator, tail = SPEC.partition(f"<!-- {mark} -->")
    assert separator, f"SPEC.md has no table marked {mark}"
    lines = tail.lstrip().splitlines()
    rows = lines[: next(i for i, line in enumerate(lines) if not line.startswith("|"))]
    return [[cell.strip().strip("`") for cell in row.strip("|").split("|")] for row in rows[2:]]


@pytest.mark.parametrize("name", sorted(set(STRUCTS) - {"WriteConfigurationArguments"}))
def test_layout_tables_of_the_spec_equal_the_definitions(name: str) -> None:
    rows = [(int(offset), int(size), field) for offset, size, field, *_ in read_table(f"layout: bootloader.{name}")]
    assert rows == [(field.offset, field.size, field.name) for field in list_fields(STRUCTS[name])]


@pytest.mark.parametrize("name", sorted(ENUMS))
def test_name_tables_of_the_spec_equal_the_definitions(name: str) -> None:
    rows = read_table(f"names: {name}")
    assert {row[1]: int(row[0], 16) for row in rows} == {member.name: member.value for member in ENUMS[name]}


@pytest.mark.parametrize(("column", "device"), list(enumerate(BootDevice, start=1)))
def test_flash_table_of_the_spec_equals_the_layouts(column: int, device: BootDevice) -> None:
    layout = boot.LAYOUTS[device]
    rows = {row[0]: [int(number) for number in re.findall(r"\d+", row[column])] for row in read_table("layouts")}
    ends = [first + layout.slot_rows - 1 for first in layout.first_rows]
    assert rows["bootloader"] == [0, layout.bootloader_rows - 1]
    slots = [rows["slot A"], rows["slot B"]]
    assert [slot for slot in slots if slot] == [list(slot) for slot in zip(layout.first_rows, ends, strict=True)]
    assert ends[-1] + 1 == layout.configuration_row  # no row is without use
    assert rows["configuration"] == [layout.configuration_row, layout.configuration_row + 1]
    assert rows["metadata"] == [layout.metadata_row, layout.row_count - 1]
    # Sizes of a slot in KiB that the text of SPEC.md states for each device.
    small, large = {BootDevice.BOARD_16K: 11.5}, {BootDevice.BOARD_64K: 27.75, BootDevice.HUB_64K: 27.75}
    assert layout.slot_size == ({device: 13.75} | small | large)[device] * 1024


@pytest.mark.parametrize("device", [BootDevice.BOARD, BootDevice.HUB])
def test_records_of_a_part_with_32_kib_are_in_the_rows_of_the_constants(device: BootDevice) -> None:
    layout = boot.LAYOUTS[device]
    assert (layout.configuration_row, layout.metadata_row) == (boot.BOOT_CONFIGURATION_ROW, boot.BOOT_METADATA_ROW)


def test_generated_files_are_not_stale() -> None:
    run = subprocess.run(
        [sys.executable, REPOSITORY / "tools" / "codegen" / "bootloader_header.py", "--check"],
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr


def test_checksums_have_their_published_values() -> None:
    assert compute_checksum(BootChecksum.CRC, b"123456789") == 0x6E90  # CRC-16/X-25 is 0x906E; its bytes are swapped
    assert compute_checksum(BootChecksum.SUM, b"123456789") == 0x10000 - 0x01DD
    assert build_packet(BootCommand.ENTER) == bytes.fromhex("01 38 00 00 C7 FF 17")


@pytest.mark.parametrize("kind", [BootChecksum.SUM, BootChecksum.CRC])
def test_parsing_a_built_packet_returns_its_content(kind: BootChecksum) -> None:
    rng = random.Random(SEED)
    for size in range(58):  # a packet has at most 57 bytes of data
        data = rng.randbytes(size)
        packet = build_packet(BootCommand.SEND_DATA, data, kind)
        assert len(packet) == size + boot.BOOT_PACKET_OVERHEAD
        assert parse_packet(packet + b"\xff" * 9, kind) == (BootCommand.SEND_DATA, data)


@pytest.mark.parametrize("kind", [BootChecksum.SUM, BootChecksum.CRC])
def test_a_packet_with_a_flipped_bit_is_rejected(kind: BootChecksum) -> None:
    packet = build_packet(BootCommand.PROGRAM_ROW, bytes(range(20)), kind)
    for bit in range(8 * len(packet)):
        damaged = bytearray(packet)
        damaged[bit // 8] ^= 1 << bit % 8
        with pytest.raises(ValueError, match="bootloader packet"):
            parse_packet(bytes(damaged), kind)


@pytest.mark.parametrize(
    ("packet", "message"),
    [
        (b"", "at least 7 bytes"),
        (b"\x01\x38\x00\x00\xc7\xff", "at least 7 bytes"),
        (b"\xff" * 8, "begins with 01, not FF"),
        (b"\x01\x38\x01\x00\xc7\xff\x17", "claims 1 bytes"),
        (b"\x01\x38\x00\x00\xc7\xff\x18", "ends with 17, not 18"),
        (b"\x01\x38\x00\x00\xc8\xff\x17", "should be FFC7, not FFC8"),
    ],
)
def test_an_invalid_packet_is_rejected_with_its_reason(packet: bytes, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse_packet(packet)


def test_a_packet_holds_at_most_57_data_bytes() -> None:
    with pytest.raises(ValueError, match="57 bytes of data, not 58"):
        build_packet(BootCommand.SEND_DATA, bytes(58))


@pytest.mark.parametrize(
    ("device", "slot"),
    [(device, slot) for device in BootDevice for slot in range(len(boot.LAYOUTS[device].first_rows))],
)
def test_an_image_has_a_matching_header(device: BootDevice, slot: int) -> None:
    content = random.Random(SEED).randbytes(333)
    data = build_image(device, slot, 5, (1, 2, 3), content)
    header, tail = unpack(boot.ImageHeader, data)
    assert tail == content + bytes(3)
    assert header["length"] == len(data) == 32 + 333 + 3  # header, content, padding to whole words
    assert header["vectors"] == boot.LAYOUTS[device].slot_address(slot) + 32
    assert header["crc32"] == crc32(data[:28] + data[32:])
    assert (header["device"], header["slot"], header["kind"]) == (device, slot, 5)
    parsed = boot.ImageHeader.parse(data)
    assert (parsed.version_major, parsed.version_minor, parsed.version_patch) == (1, 2, 3)


def test_an_image_for_slot_b_of_a_device_with_one_slot_is_rejected() -> None:
    with pytest.raises(ValueError, match="a device board_16k has slots A, not slot 1"):
        build_image(BootDevice.BOARD_16K, 1, 0, (1, 2, 3), bytes(64))


def test_an_image_that_does_not_fit_its_slot_is_rejected() -> None:
    """A slot of a board has 13.75 KiB = 14080 bytes. An image is a header of 32 bytes and a program of 8 or more."""
    assert len(build_image(BootDevice.BOARD, 0, 0, (1, 0, 0), bytes(14080 - 32))) == 14080
    for size in (0, 4, 14080 - 31):
        with pytest.raises(ValueError, match="an image for this slot has 40 to 14080 bytes"):
            build_image(BootDevice.BOARD, 0, 0, (1, 0, 0), bytes(size))


def test_a_record_whose_words_add_up_to_zero_is_balanced() -> None:
    # Found by a search: all words of the row with this content, including the CRC, add up to zero.
    content = b"\x02" + bytes(107) + (0xEFAAAE75).to_bytes(4, "little")
    row = build_record(boot.BOOT_CONFIGURATION_MAGIC, 0, content)
    fields, tail = unpack(boot.Record, row)
    assert len(row) == boot.BOOT_ROW_SIZE
    assert not tail
    assert fields["crc32"] == crc32(row[:120])
    assert fields["balance"] == 1
    assert sum(int.from_bytes(row[i : i + 4], "little") for i in range(0, 124, 4)) % 2**32 == 0


def test_a_record_of_ordinary_content_needs_no_balance() -> None:
    metadata = pack(boot.Metadata, {"confirmed": 0, "pending": 1, "tries": bytes([3, 2])})
    assert unpack(boot.Record, build_record(boot.BOOT_METADATA_MAGIC, 9, metadata))[0]["balance"] == 0


def test_a_record_holds_at_most_112_bytes_of_content() -> None:
    with pytest.raises(ValueError, match="at most 112 bytes of content, not 113"):
        build_record(boot.BOOT_METADATA_MAGIC, 0, bytes(113))


def test_row_sum_equals_the_checksum_of_a_cyacd_line() -> None:
    """The .cyacd file of a firmware states for each flash row the array, row number, length, bytes and checksum.

    A host adds array, row number and length to the checksum, and compares the result with the row sum of the device.
    """
    row = random.Random(SEED).randbytes(128)
    array, number = 0, 0x0123
    line = bytes([array]) + number.to_bytes(2, "big") + len(row).to_bytes(2, "big") + row
    line_sum = -sum(line) & 0xFF
    assert compute_row_sum(row) == (line_sum + array + number + (number >> 8) + len(row) + (len(row) >> 8)) & 0xFF


class Bus:
    """Boards at one address: a read returns the AND of the replies of all boards that acknowledge."""

    def __init__(self, ids: list[int]) -> None:
        """Create a bus with the boards of these unique ids."""
        self.ids = ids
        self.searches = 0

    def send_search(self, bits: int, prefix: bytes) -> bytes | None:
        """Return the reply to a search for ids that begin with the first `bits` bits of `prefix`; None: no board."""
        self.searches += 1
        shift = 64 - bits
        answering = [i for i in self.ids if i >> shift == int.from_bytes(prefix, "big") >> shift]
        if not answering:
            return None
        ones = zeros = 2**64 - 1
        for identity in answering:
            ones &= identity
            zeros &= ~identity
        return ones.to_bytes(8, "big") + zeros.to_bytes(8, "big")


def make_id_sets() -> dict[str, list[int]]:
    """Return sets of unique ids, by name, that a search must find."""
    rng = random.Random(SEED)
    return {
        "none": [],
        "one": [rng.getrandbits(64)],
        "random": [rng.getrandbits(64) for _ in range(17)],
        "of one wafer": [0x0123456700001000 + i for i in range(17)],
        "each a prefix of the next": [(1 << 3 * i) - 1 for i in range(17)],
        "first and last bit": [0, 1, 1 << 63, (1 << 63) + 1],
    }


@pytest.mark.parametrize("name", make_id_sets())
def test_every_board_at_a_shared_address_is_found(name: str) -> None:
    ids = make_id_sets()[name]
    bus = Bus(ids)
    unique_ids = find_unique_ids(bus.send_search)
    assert [int.from_bytes(identity, "big") for identity in unique_ids] == sorted(ids)
    # n boards take 2 n - 1 searches, and one more each as a confirmation.
    assert bus.searches <= max(1, 3 * len(ids) - 1)


def test_an_inconsistent_reply_ends_the_search() -> None:
    with pytest.raises(ValueError, match="same bit in id and complement"):
        find_unique_ids(lambda bits, prefix: b"\xff" * 16)
