"""A checked firmware image, and the set of images that form one firmware version."""

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
from taxel_protocol.layout import get_packer, unpack
from taxel_tools.errors import FirmwareFileError

HEADER_SIZE: Final = get_packer(ImageHeader).size
CRC_OFFSET: Final = 28
IMAGE_SIZE_MIN: Final = HEADER_SIZE + 8


def format_slot(slot: int) -> str:
    """Format the letter of a flash slot: "A" for 0, "B" for 1."""
    return "AB"[slot]


@dataclass(frozen=True)
class FirmwareImage:
    """An image linked for one slot. `data` includes the header; `source` names the file."""

    data: bytes
    device: BootDevice
    kind: int
    slot: int
    version: tuple[int, int, int]
    source: str

    @property
    def crc(self) -> int:
        """CRC-32 of the firmware image, from its header."""
        return int.from_bytes(self.data[CRC_OFFSET:HEADER_SIZE], "little")

    def rows(self) -> list[bytes]:
        """Divide the firmware image into flash rows; the last row is padded with zeros."""
        padded = self.data + bytes(-len(self.data) % BOOT_ROW_SIZE)
        return [padded[begin : begin + BOOT_ROW_SIZE] for begin in range(0, len(padded), BOOT_ROW_SIZE)]


@dataclass(frozen=True)
class Firmware:
    """One version for one kind of board, linked for one slot or for both."""

    images: tuple[FirmwareImage, ...]

    def select_image_for(self, slot: int) -> FirmwareImage | None:
        """Return the firmware image that is linked for a flash slot; None if there is none."""
        return next((image for image in self.images if image.slot == slot), None)

    @property
    def device(self) -> BootDevice:
        """Device on which the firmware runs."""
        return self.images[0].device

    @property
    def kind(self) -> int:
        """Board kind for which the firmware is built; 0: any kind."""
        return self.images[0].kind

    @property
    def version(self) -> tuple[int, int, int]:
        """Version of the firmware: major, minor, patch."""
        return self.images[0].version

    @property
    def source(self) -> str:
        """Names of the files that contain the firmware."""
        return " and ".join(dict.fromkeys(image.source for image in self.images))


def parse_image(data: bytes, source: str, first_row: int | None = None) -> FirmwareImage:
    """Parse a firmware image and check it with the rules of the bootloader. Raises `FirmwareFileError`.

    first_row: flash row where the file places the image; None: unknown. Bytes after the length in the header are
    ignored.
    """

    def fail(field: str, expected: str, found: str, remedy: str = "build the image again") -> NoReturn:
        """Raise `FirmwareFileError` for a field of the image header."""
        raise FirmwareFileError(source, field, expected, found, remedy)

    if len(data) < IMAGE_SIZE_MIN:
        fail("image", f"at least {IMAGE_SIZE_MIN} bytes", f"{len(data)}", "the file is truncated; copy it again")
    fields, _ = unpack(ImageHeader, data)
    if fields["magic"] != BOOT_IMAGE_MAGIC:
        fail("image header", "an image that begins with TXLI", data[:4].hex(" ").upper(), "is this a taxel image?")
    if fields["header_version"] != BOOT_VERSION:
        fail("image header version", str(BOOT_VERSION), str(fields["header_version"]), "update this program")
    if fields["device"] not in BootDevice._value2member_map_:
        devices = ", ".join(f"{device:d} ({device.name.lower()})" for device in BootDevice)
        fail("image header device", devices, str(fields["device"]))
    layout = LAYOUTS[BootDevice(fields["device"])]
    if fields["slot"] >= len(layout.first_rows):
        slots = " or ".join(f"{slot} ({format_slot(slot)})" for slot in range(len(layout.first_rows)))
        fail("image header slot", slots, str(fields["slot"]))
    begin = layout.slot_address(fields["slot"])
    if first_row is not None and first_row * BOOT_ROW_SIZE != begin:
        fail(
            "image header slot",
            f"row {begin // BOOT_ROW_SIZE}, where slot {format_slot(fields['slot'])} begins",
            f"row {first_row}",
            "link the image for the slot in its header",
        )
    length = fields["length"]
    if not IMAGE_SIZE_MIN <= length <= layout.slot_size or length % 4:
        fail("image header length", f"{IMAGE_SIZE_MIN} to {layout.slot_size}, a multiple of 4", str(length))
    if length > len(data):
        fail("image", f"{length} bytes, as its header states", f"{len(data)}", "the file is truncated; copy it again")
    if not begin + HEADER_SIZE <= fields["vectors"] <= begin + length - 8:
        fail(
            "image header vectors", f"an address within slot {format_slot(fields['slot'])}", f"0x{fields['vectors']:X}"
        )
    expected = crc32(data[:CRC_OFFSET] + data[HEADER_SIZE:length])
    if fields["crc32"] != expected:
        fail("image CRC-32", f"{expected:08X}", f"{fields['crc32']:08X}", "the file is damaged; copy it again")
    version = (fields["version_major"], fields["version_minor"], fields["version_patch"])
    return FirmwareImage(data[:length], layout.device, fields["kind"], fields["slot"], version, source)
