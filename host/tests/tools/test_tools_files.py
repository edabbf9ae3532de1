"""Firmware files: files are read back as written, and each kind of damage has its own error message."""

import hashlib
import json
import random
from contextlib import suppress

import pytest

from taxel_protocol.bootloader import BOOT_ROW_COUNT, BOOT_ROW_SIZE, BootChecksum, BootDevice
from taxel_tools.errors import FirmwareFileError
from taxel_tools.files import load_firmware
from taxel_tools.files.cyacd import read_cyacd, write_cyacd
from taxel_tools.files.intel_hex import read_intel_hex, read_intel_hex_rows, write_intel_hex

FIRST_ROWS = (32, 142)


def cyacd_row(row: int, data: bytes, array: int = 0) -> str:
    """Format a row line of a .cyacd file with a correct checksum."""
    body = bytes([array]) + row.to_bytes(2, "big") + len(data).to_bytes(2, "big") + data
    return ":" + (body + bytes([-sum(body) & 0xFF])).hex().upper()


def read_error(lines: list[str]) -> str:
    """Return the one-line message with which the lines of a .cyacd file are refused."""
    with pytest.raises(FirmwareFileError) as error:
        read_cyacd("\n".join(lines), "f.cyacd")
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.fixture
def lines(make_image) -> list[str]:
    """Lines of a valid `.cyacd` file for slot A."""
    return write_cyacd(make_image(0), 32).splitlines()


@pytest.mark.parametrize("slot", [0, 1])
@pytest.mark.parametrize("size", [40, 128, 1000, 14080])
def test_a_cyacd_file_is_read_back_as_written(make_image, slot, size):
    image = make_image(slot, size=size)
    read_image = read_cyacd(write_cyacd(image, FIRST_ROWS[slot], BootChecksum.CRC), "f")
    assert (read_image.data, read_image.slot, read_image.version, read_image.crc) == (
        image.data,
        slot,
        (1, 2, 3),
        image.crc,
    )


@pytest.mark.parametrize("slot", [0, 1])
def test_an_intel_hex_file_is_read_back_as_written(make_image, slot):
    image = make_image(slot)
    assert read_intel_hex(write_intel_hex(image.data, 128 * FIRST_ROWS[slot]), "f").data == image.data


def test_blank_lines_of_an_intel_hex_file_are_skipped(make_image):
    image = make_image(0)
    lines = write_intel_hex(image.data, 128 * FIRST_ROWS[0]).splitlines()
    assert read_intel_hex("\n".join([*lines[:3], "", *lines[3:], ""]), "f").data == image.data


def test_an_intel_hex_file_may_fill_the_last_row_of_the_flash():
    row = bytes(range(BOOT_ROW_SIZE))
    rows = read_intel_hex_rows(write_intel_hex(row, BOOT_ROW_SIZE * (BOOT_ROW_COUNT - 1)), "f")
    assert {number: data for number, (data, _) in rows.items()} == {BOOT_ROW_COUNT - 1: row}


@pytest.mark.parametrize("device", [BootDevice.BOARD_64K, BootDevice.HUB_64K])
def test_slot_b_of_a_part_with_64_kib_begins_at_another_row(make_image, device):
    image = make_image(1, device=device)
    assert read_cyacd(write_cyacd(image, 286), "f").device == device


@pytest.mark.parametrize(
    ("damage", "expected_text"),
    [
        (lambda lines: [], "line 1: expected a header of 12 digits, found 0"),
        (lambda lines: ["04C81193"], "line 1: expected a header of 12 digits, found 8"),
        (
            lambda lines: ["04A61193" + "0000", *lines[1:]],
            "expected silicon id 04C81193 or 04FA1193 or 1B2511AB, found 04A6",
        ),
        (lambda lines: ["04FA1193" + "0000", *lines[1:]], "expected silicon id 04C81193, found 04FA1193"),
        (lambda lines: ["04C811930009", *lines[1:]], "line 1: expected checksum kind 0 or 1, found 9"),
        (lambda lines: lines[:1], "file: expected rows after the header, found none"),
        (lambda lines: [*lines[:3], lines[3][:-2] + "00", *lines[4:]], "line 4: expected checksum "),
        (lambda lines: [*lines[:3], lines[3].replace("0", "G", 1), *lines[4:]], "line 4: expected hexadecimal digits"),
        (
            lambda lines: [*lines[:3], lines[3][:-1], *lines[4:]],
            "line 4: expected two hexadecimal digits for each byte",
        ),
        (lambda lines: [*lines[:3], lines[3][:-10], *lines[4:]], "line 4: expected 128 bytes of data, found 123"),
        (lambda lines: [*lines[:3], lines[3][1:], *lines[4:]], "line 4: expected a row that begins with ':'"),
        (lambda lines: [*lines[:3], ":0000", *lines[4:]], "line 4: expected at least 6 bytes"),
        (
            lambda lines: [*lines, lines[3]],
            "line 10: expected each row once, found row 34 a second time (first in line 4)",
        ),
        (lambda lines: lines[:-1], "f.cyacd: image: expected 1000 bytes, as its header states, found 896; the file is"),
        (
            lambda lines: [*lines, cyacd_row(0, bytes(128))],
            "line 10: expected rows from 32 on, found row 0 of the boot",
        ),
        (lambda lines: [*lines, cyacd_row(31, bytes(128))], "the bootloader cannot replace itself"),
        (
            lambda lines: [*lines, cyacd_row(254, bytes(128))],
            "line 10: expected rows 32 to 141 or 142 to 251, found ro",
        ),
        (lambda lines: [*lines, cyacd_row(300, bytes(128))], "found row 300, beyond the flash"),
        (lambda lines: [*lines, cyacd_row(150, bytes(128))], "expected rows of one slot, found rows of slots A and B"),
        (lambda lines: [*lines, cyacd_row(60, bytes(64))], "line 10: expected rows of 128 bytes, found 64"),
        (lambda lines: [*lines, cyacd_row(60, bytes(128), 1)], "line 10: expected flash array 0, found 1"),
        (lambda lines: [*lines[:4], cyacd_row(35, bytes(128)), *lines[5:]], "image CRC-32: expected "),
        (
            lambda lines: [lines[0], *lines[2:]],
            "image header: expected an image that begins with TXLI in the first row",
        ),
    ],
)
def test_each_kind_of_damage_of_a_cyacd_file_has_its_own_message(lines, damage, expected_text):
    message = read_error(damage(lines))
    assert expected_text in message
    assert message.startswith("f.cyacd: ")


def test_an_image_linked_for_the_other_slot_is_refused(make_image):
    message = read_error(write_cyacd(make_image(1), 32).splitlines())
    assert "image header slot: expected row 142, where slot B begins, found row 32" in message


@pytest.mark.parametrize(
    ("damage", "expected_text"),
    [
        (lambda lines: lines[:-1], "file: expected an end record (:00000001FF), found none"),
        (lambda lines: [lines[0][:-2] + "00", *lines[1:]], "line 1: expected checksum "),
        (lambda lines: [lines[0][:-4], *lines[1:]], "line 1: expected 16 bytes of data, found 14"),
        (lambda lines: ["x" + lines[0], *lines[1:]], "line 1: expected a record that begins with ':'"),
        (lambda lines: [":zz", *lines[1:]], "line 1: expected two hexadecimal digits for each byte"),
        (lambda lines: [*lines, lines[0]], "expected nothing after the end record"),
        (lambda lines: [lines[0], *lines], "line 2: expected each byte once, found address 0x1000 a second time"),
        (lambda lines: [":0100000000FF", *lines], "line 1: expected rows from 32 on, found row 0 of the bootloader"),
        (lambda lines: [":020000049030" + "3A", ":0100000000FF", *lines], "beyond the flash"),
        (lambda lines: [":00000007F9", *lines], "line 1: expected record type 0 to 5, found 7"),
        (lambda lines: [*lines[:5], *lines[6:]], "image CRC-32: expected "),
    ],
)
def test_each_kind_of_damage_of_an_intel_hex_file_has_its_own_message(make_image, damage, expected_text):
    lines = write_intel_hex(make_image(0).data, 32 * 128).splitlines()
    with pytest.raises(FirmwareFileError) as error:
        read_intel_hex("\n".join(damage(lines)), "f.hex")
    assert expected_text in str(error.value)


def test_a_truncated_raw_image_is_refused(tmp_path, make_image):
    path = tmp_path / "f.bin"
    for size in (0, 39, 500):  # no byte, little more than the header of 32 bytes, half of the image
        path.write_bytes(make_image(0).data[:size])
        with pytest.raises(FirmwareFileError, match="the file is truncated; copy it again"):
            load_firmware([path])


def test_a_damaged_byte_is_detected_in_every_format(tmp_path, make_image):
    image = make_image(0)
    contents = {
        "f.bin": image.data,
        "f.cyacd": write_cyacd(image, 32).encode(),
        "f.hex": write_intel_hex(image.data, 32 * 128).encode(),
    }
    seed = 5
    print(f"seed {seed}")
    generator = random.Random(seed)
    for name, data in contents.items():
        for _ in range(150):
            damaged = bytearray(data)
            damaged[generator.randrange(len(data))] ^= 1 << generator.randrange(8)
            path = tmp_path / name
            path.write_bytes(damaged)
            with suppress(FirmwareFileError):
                # Accepted changes: a letter in lower case, another line end, the revision, which is not checked.
                assert load_firmware([path]).images[0].data == image.data


@pytest.fixture
def manifest(tmp_path, make_image):
    """Writes a manifest with a `.cyacd` file for slot A and a raw image for slot B; returns its path."""
    image, other_image = make_image(0, kind=3), make_image(1, kind=3)
    (tmp_path / "a.cyacd").write_text(write_cyacd(image, 32))
    (tmp_path / "b.bin").write_bytes(other_image.data[32:])

    def write(**changes):
        """Write the manifest and return its path.

        changes: new values by key and index of the entry, such as slot1="A"; None removes the key.
        """
        entries = [
            {"file": "a.cyacd", "sha256": hashlib.sha256((tmp_path / "a.cyacd").read_bytes()).hexdigest()},
            {"file": "b.bin", "device": "board", "kind": 3, "slot": "B", "version": "1.2.3"},
        ]
        for key, value in changes.items():
            index, name = int(key[-1]), key[:-1]
            entries[index][name] = value
            if value is None:
                del entries[index][name]
        path = tmp_path / "m.json"
        path.write_text(json.dumps({"taxel_firmware": 1, "image": entries}))
        return path

    return write


def test_a_manifest_names_both_slots_and_adds_the_header_of_a_raw_image(manifest, make_image):
    firmware = load_firmware([manifest()])
    assert [image.slot for image in firmware.images] == [0, 1]
    assert firmware.images[1].data == make_image(1, kind=3).data


def test_a_manifest_may_be_toml(tmp_path, make_image):
    (tmp_path / "a.bin").write_bytes(make_image(0).data)
    (tmp_path / "m.toml").write_text('taxel_firmware = 1\n[[image]]\nfile = "a.bin"\nslot = "A"\n')
    assert load_firmware([tmp_path / "m.toml"]).select_image_for(0) is not None


@pytest.mark.parametrize(
    ("changes", "expected_text"),
    [
        ({"sha2560": "00"}, "image[0].sha256: expected 00, found "),
        ({"slot1": None}, "image[1].slot: expected a value, as the raw image has no header, found none; add slot"),
        ({"slot1": "C"}, "image[1].slot: expected A or B, found 'C'"),
        ({"version1": "1.2"}, "image[1].version: expected three numbers such as 1.2.0, found '1.2'"),
        ({"device1": "arm"}, "image[1].device: expected board or hub"),
        ({"kind1": True}, "image[1].kind: expected 0 to 255, found true"),
        ({"kind1": 4}, "image kind: expected 3, as in "),
        ({"kind0": 4}, "image[0].kind: expected 4, found 3 in "),
        ({"slot0": "B"}, "image[0].slot: expected B, found A in "),
        ({"version0": "9.9.9"}, "image[0].version: expected 9.9.9, found 1.2.3 in "),
        ({"colour0": 1}, "image[0].colour: expected one of device, file, kind, sha256, slot, version"),
        ({"file0": 5}, "image[0].file: expected a file name of at most 255 characters, found 5"),
        ({"slot1": "A"}, "expected one image for slot A, found a second one"),
    ],
)
def test_a_manifest_that_contradicts_its_files_is_refused(manifest, changes, expected_text):
    with pytest.raises(FirmwareFileError) as error:
        load_firmware([manifest(**changes)])
    assert expected_text in str(error.value)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"taxel_firmware": 2}', '{"taxel_firmware": 1, "image": []}'])
def test_a_file_that_is_not_a_manifest_is_refused(tmp_path, text):
    (tmp_path / "m.json").write_text(text)
    with pytest.raises(FirmwareFileError, match=r"m\.json: "):
        load_firmware([tmp_path / "m.json"])


def test_files_of_two_versions_are_refused(tmp_path, make_image):
    (tmp_path / "a.bin").write_bytes(make_image(0).data)
    (tmp_path / "b.bin").write_bytes(make_image(1, version=(2, 0, 0)).data)
    with pytest.raises(FirmwareFileError, match="image version: expected"):
        load_firmware([tmp_path / "a.bin", tmp_path / "b.bin"])


def test_a_file_of_an_unsupported_format_is_refused(tmp_path):
    (tmp_path / "f.elf").write_bytes(b"\x7fELF")
    with pytest.raises(FirmwareFileError, match=r"found '\.elf'; rename or convert it"):
        load_firmware([tmp_path / "f.elf"])


def test_a_text_format_with_a_byte_beyond_ascii_is_refused(tmp_path):
    (tmp_path / "f.cyacd").write_bytes(b"04C811930000\n:\xff\n")
    with pytest.raises(FirmwareFileError, match="line 2: expected ASCII text, found byte FF"):
        load_firmware([tmp_path / "f.cyacd"])
