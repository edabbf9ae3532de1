"""An image that has been read and found whole, and the set of them that one version consists of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NoReturn

from taxel_protocol.bootloader import (
    BOOT_IMAGE_MAGIC,
    BOOT_ROW_SIZE,
    BOOT_VERSION,
    LAYOUTS,
    BootDevice,
    ImageHeader,
)
from taxel_protocol.framing import crc32
from taxel_protocol.layout import packer_of, unpack
from taxel_tools.errors import FirmwareFileError

HEADER_SIZE: Final = packer_of(ImageHeader).size
CRC_OFFSET: Final = 28
SMALLEST: Final = HEADER_SIZE + 8


def slot_name(slot: int) -> str:
    """A or B."""
    return "AB"[slot]


@dataclass(frozen=True)
class FirmwareImage:
    """An image linked for one slot; `data` is header and all, `source` the file it came from."""

    data: bytes
    device: BootDevice
    kind: int
    slot: int
    version: tuple[int, int, int]
    source: str

    @property
    def crc(self) -> int:
        """The CRC-32 of its header."""
        return int.from_bytes(self.data[CRC_OFFSET:HEADER_SIZE], "little")

    def rows(self) -> list[bytes]:
        """The flash rows that it fills, the last one filled up with zeros."""
        padded = self.data + bytes(-len(self.data) % BOOT_ROW_SIZE)
        return [padded[begin : begin + BOOT_ROW_SIZE] for begin in range(0, len(padded), BOOT_ROW_SIZE)]


@dataclass(frozen=True)
class Firmware:
    """One version for one kind of board, linked for one slot or for both."""

    images: tuple[FirmwareImage, ...]

    def image_for(self, slot: int) -> FirmwareImage | None:
        """The image linked for that slot, if there is one."""
        return next((image for image in self.images if image.slot == slot), None)

    @property
    def device(self) -> BootDevice:
        """What it runs on."""
        return self.images[0].device

    @property
    def kind(self) -> int:
        """Design of the board; 0: any."""
        return self.images[0].kind

    @property
    def version(self) -> tuple[int, int, int]:
        """Major, minor, patch."""
        return self.images[0].version

    @property
    def source(self) -> str:
        """The files it came from."""
        return " and ".join(dict.fromkeys(image.source for image in self.images))


def parse_image(data: bytes, source: str, first_row: int | None = None) -> FirmwareImage:
    """Check an image byte for byte as the bootloader will. first_row: where its file puts it; None: it does not say.

    Bytes after the length that the header claims are not looked at. Raises `FirmwareFileError`.
    """

    def fail(field: str, expected: str, found: str, remedy: str = "build it anew") -> NoReturn:
        raise FirmwareFileError(source, field, expected, found, remedy)

    if len(data) < SMALLEST:
        fail("image", f"at least {SMALLEST} bytes", f"{len(data)}", "the file is cut short; copy it anew")
    fields, _ = unpack(ImageHeader, data)
    if fields["magic"] != BOOT_IMAGE_MAGIC:
        fail("image header", "an image that begins with TXLI", data[:4].hex(" ").upper(), "is this a taxel image?")
    if fields["header_version"] != BOOT_VERSION:
        fail("image header version", str(BOOT_VERSION), str(fields["header_version"]), "update this program")
    if fields["device"] not in BootDevice._value2member_map_:
        fail("image header device", "1 (board) or 2 (hub)", str(fields["device"]))
    layout = LAYOUTS[BootDevice(fields["device"])]
    if fields["slot"] > 1:
        fail("image header slot", "0 (A) or 1 (B)", str(fields["slot"]))
    begin = layout.slot_address(fields["slot"])
    if first_row is not None and first_row * BOOT_ROW_SIZE != begin:
        fail(
            "image header slot",
            f"row {begin // BOOT_ROW_SIZE}, where slot {slot_name(fields['slot'])} begins",
            f"row {first_row}",
            "link it for the slot that its header names",
        )
    length = fields["length"]
    if not SMALLEST <= length <= layout.slot_size or length % 4:
        fail("image header length", f"{SMALLEST} to {layout.slot_size}, a multiple of 4", str(length))
    if length > len(data):
        fail("image", f"{length} bytes, as its header says", f"{len(data)}", "the file is cut short; copy it anew")
    if not begin + HEADER_SIZE <= fields["vectors"] <= begin + length - 8:
        fail("image header vectors", f"an address within slot {slot_name(fields['slot'])}", f"0x{fields['vectors']:X}")
    expected = crc32(data[:CRC_OFFSET] + data[HEADER_SIZE:length])
    if fields["crc32"] != expected:
        fail("image CRC-32", f"{expected:08X}", f"{fields['crc32']:08X}", "the file is damaged; copy it anew")
    version = (fields["version_major"], fields["version_minor"], fields["version_patch"])
    return FirmwareImage(data[:length], layout.device, fields["kind"], fields["slot"], version, source)
