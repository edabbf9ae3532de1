"""Write the files for hosts and programmers from the linked images of one device.

    python tools/firmware/firmware_image.py --bootloader ELF --slot-a ELF --slot-b ELF --name board --out DIR

Writes DIR/NAME-a and -b as .bin, .hex and .cyacd with complete headers, the manifest DIR/NAME.toml of both, and
DIR/NAME-factory.hex for a programmer with the bootloader and the image of slot A; and a signature (.sig) of each image
and of the factory file, with the private key --key or the development key. The same input gives the same bytes.
A board with 16 KiB of flash has no slot B: without --slot-b. --pins: the image is for one kind of board, that of the
pins file.
"""

import argparse
import hashlib
import os
import re
import sys
from pathlib import Path
from typing import Final, NoReturn

from board_header import read_kind_code
from firmware_elf import LinkedImage, read_linked_image

from taxel.errors import TaxelError
from taxel.optional import MissingPackageError
from taxel_protocol.bootloader import BOOT_ROW_SIZE, LAYOUTS, BootDevice
from taxel_protocol.bootloader_images import build_image
from taxel_tools.errors import FirmwareFileError
from taxel_tools.files.cyacd import write_cyacd
from taxel_tools.files.firmware import HEADER_SIZE, FirmwareImage, format_slot, parse_image
from taxel_tools.files.intel_hex import write_intel_hex
from taxel_tools.signing import (
    PASSPHRASE_VARIABLE,
    load_development_key,
    load_private_key,
    sign_file,
    sign_images,
)

VERSION_FILE: Final = Path(__file__).parents[2] / "host" / "taxel" / "version.py"
RAM_BEGIN: Final = 0x20000000
RAM_SIZES: Final = {BootDevice.BOARD_64K: 0x2000, BootDevice.HUB_64K: 0x2000}
"""Bytes of RAM of the parts that do not have 4 KiB."""
HEX_END: Final = ":00000001FF\n"
ANY_KIND: Final = 0


def _fail(path: str, field: str, expected: str, found: str, remedy: str) -> NoReturn:
    """Raise `FirmwareFileError` for a defect of a linked firmware image."""
    raise FirmwareFileError(path, field, expected, found, remedy)


def read_project_version(version_file: Path) -> tuple[int, int, int]:
    """Read the project's version from taxel/version.py. Raises FirmwareFileError, OSError."""
    line = re.search(r'^VERSION = "(.*)"$', version_file.read_text(), re.MULTILINE)
    if line is None:
        _fail(str(version_file), "VERSION", "a version", "none", "add it")
    text = line[1]
    match = re.fullmatch(r"(\d{1,3})\.(\d{1,3})\.(\d{1,3})", text)
    numbers = tuple(int(part) for part in match.groups()) if match else ()
    if len(numbers) != 3 or max(numbers) > 255:
        _fail(
            str(version_file),
            "VERSION",
            "three numbers to 255, such as 1.2.0",
            repr(text),
            "an image header has three bytes",
        )
    return numbers[0], numbers[1], numbers[2]


def _check_vectors(linked: LinkedImage, offset: int) -> None:
    """Check the first two entries of the vector table at `offset` of a linked image.

    The stack pointer must be in RAM, and the reset vector in the image, with the Thumb bit set.
    """
    stack, reset = (int.from_bytes(linked.content[at : at + 4], "little") for at in (offset, offset + 4))
    ram_size = RAM_SIZES.get(_read_device(linked), 0x1000)
    if not RAM_BEGIN < stack <= RAM_BEGIN + ram_size or stack % 8:
        _fail(linked.path, "stack pointer", "a multiple of 8 in RAM", f"0x{stack:08X}", "correct the vector table")
    end = linked.address + len(linked.content)
    if not linked.address + offset + 8 <= reset < end or not reset & 1:
        expected = f"Thumb code from 0x{linked.address + offset + 8:X} to 0x{end:X}"
        _fail(linked.path, "reset vector", expected, f"0x{reset:08X}", "correct the vector table")


def build_slot_image(
    linked: LinkedImage, slot: int, version: tuple[int, int, int], kind: int = ANY_KIND
) -> FirmwareImage:
    """Build a firmware image with a complete header from a linked image.

    slot: 0 (A) or 1 (B). kind: code of the only kind of board on which the image runs; 0: any. Raises FirmwareFileError
    if the image is not linked for this slot.
    """
    device = _read_device(linked)
    layout = LAYOUTS[device]
    linked_slot = linked.symbol("image_slot")
    if slot >= len(layout.first_rows):
        _fail(linked.path, "slot", f"slot A, the only one of a {device.name.lower()}", "slot B", "omit --slot-b")
    if linked_slot != slot or linked.address != layout.slot_address(slot):
        place = f"slot {format_slot(slot)} of a {device.name.lower()}, 0x{layout.slot_address(slot):X}"
        _fail(linked.path, "address", place, f"0x{linked.address:X}", "pass the images in the order A, B")
    if any(linked.content[:HEADER_SIZE]):
        _fail(linked.path, "header", "32 zeros to fill in", linked.content[:HEADER_SIZE].hex(), "link it again")
    _check_vectors(linked, HEADER_SIZE)
    try:
        data = build_image(device, slot, kind, version, linked.content[HEADER_SIZE:])
    except ValueError as error:
        _fail(linked.path, "size", f"at most {layout.slot_size} bytes", str(error), "reduce its size")
    return parse_image(data, linked.path)


def _read_device(linked: LinkedImage) -> BootDevice:
    """Return the device of a linked image, from its symbol `image_device`."""
    value = linked.symbol("image_device")
    if value not in LAYOUTS:
        expected = ", ".join(f"{device:d} ({device.name.lower()})" for device in BootDevice)
        _fail(linked.path, "image_device", expected, str(value), "link it again")
    return BootDevice(value)


def read_bootloader(linked: LinkedImage) -> bytes:
    """Return the bytes of a linked bootloader from address 0 on.

    Raises FirmwareFileError for an image that is not a bootloader.
    """
    size = LAYOUTS[_read_device(linked)].bootloader_rows * BOOT_ROW_SIZE
    if linked.address or len(linked.content) > size or "image_slot" in linked.symbols:
        found = f"{len(linked.content)} bytes at 0x{linked.address:X}"
        _fail(linked.path, "address", f"{size} bytes or fewer at 0", found, "pass the bootloader's ELF")
    _check_vectors(linked, 0)
    return linked.content


def format_manifest(name: str, images: list[FirmwareImage], files: list[Path]) -> str:
    """Return the text of the manifest that lists the images and their files, which are in the same folder."""
    lines = ["# Written by tools/firmware/firmware_image.py.", "taxel_firmware = 1"]
    for file_image, file in zip(images, files, strict=True):
        lines += [
            "",
            "[[image]]",
            f'file = "{file.name}"',
            f'sha256 = "{hashlib.sha256(file.read_bytes()).hexdigest()}"',
            f'device = "{file_image.device.name.lower()}"',
            f"kind = {file_image.kind}",
            f'slot = "{format_slot(file_image.slot)}"',
            f'version = "{".".join(map(str, file_image.version))}"',
        ]
    return "\n".join(lines) + "\n"


def write_images(
    bootloader: Path,
    slots: tuple[Path, ...],
    name: str,
    out: Path,
    version_file: Path = VERSION_FILE,
    key_file: Path | None = None,
    kind: int = ANY_KIND,
) -> None:
    """Write all firmware files of one device: images, manifest, factory file, and their signatures.

    slots: linked images of slots A and B; of slot A for a device with one slot. name: prefix of the file names.
    key_file: private key of the signatures; None: the development key, which only emulated devices accept. kind: code
    of the only kind of board on which the images run; 0: any. Raises FirmwareFileError, OSError; no usable manifest
    remains after an error.
    """
    version = read_project_version(version_file)
    boot_file = read_linked_image(bootloader)
    boot = read_bootloader(boot_file)
    linked = [read_linked_image(path) for path in slots]
    images = [build_slot_image(file, slot, version, kind) for slot, file in enumerate(linked)]
    for other in (boot_file, *linked[1:]):
        if _read_device(other) != images[0].device:
            device = images[0].device.name.lower()
            _fail(
                other.path,
                "device",
                f"{device}, as slot A",
                _read_device(other).name.lower(),
                "pass files of one device",
            )
    out.mkdir(parents=True, exist_ok=True)
    (out / f"{name}.toml").unlink(missing_ok=True)
    files = []
    for file_image in images:
        layout = LAYOUTS[file_image.device]
        stem = f"{name}-{format_slot(file_image.slot).lower()}"
        files.append(out / f"{stem}.cyacd")
        files[-1].write_text(write_cyacd(file_image, layout.first_rows[file_image.slot]))
        (out / f"{stem}.bin").write_bytes(file_image.data)
        (out / f"{stem}.hex").write_text(write_intel_hex(file_image.data, layout.slot_address(file_image.slot)))
    first = write_intel_hex(boot, 0).removesuffix(HEX_END)
    layout = LAYOUTS[images[0].device]
    (out / f"{name}-factory.hex").write_text(first + write_intel_hex(images[0].data, layout.slot_address(0)))
    manifest = out / f"{name}.toml"
    manifest.write_text(format_manifest(name, images, files))
    _sign(manifest, out / f"{name}-factory.hex", key_file)


def _sign(manifest: Path, factory: Path, key_file: Path | None) -> None:
    """Sign the images of a manifest and the factory file.

    key_file: private key; None: the development key. Without the package `cryptography` the files stay unsigned if no
    key is given.
    """
    try:
        key = load_private_key(key_file, os.environ.get(PASSPHRASE_VARIABLE)) if key_file else load_development_key()
    except MissingPackageError as error:
        if key_file:
            raise
        print(f"firmware_image: {manifest.name} is not signed: {error}", file=sys.stderr)
        return
    sign_images([manifest], key)
    sign_file(factory, key)


def main() -> int:
    """Write the firmware files of a device from its linked images.

    After a one-line error message the exit status is 1.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for option in ("--bootloader", "--slot-a", "--out"):
        parser.add_argument(option, type=Path, required=True)
    parser.add_argument("--slot-b", type=Path, help="omitted for a device with one slot")
    parser.add_argument("--pins", type=Path, help="pins file of the only kind of board; default: any kind")
    parser.add_argument("--name", required=True, help="prefix of the file names")
    parser.add_argument("--key", type=Path, help="private key of the signatures; default: the development key")
    options = parser.parse_args()
    try:
        slots = tuple(path for path in (options.slot_a, options.slot_b) if path)
        kind = read_kind_code(options.pins) if options.pins else ANY_KIND
        write_images(options.bootloader, slots, options.name, options.out, key_file=options.key, kind=kind)
    except (TaxelError, OSError) as error:
        print(f"firmware_image: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
