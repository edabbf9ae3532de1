"""Firmware files of any supported format, loaded as one firmware version."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from taxel_tools.errors import FirmwareFileError
from taxel_tools.files.cyacd import read_cyacd
from taxel_tools.files.firmware import Firmware, FirmwareImage, format_slot, parse_image
from taxel_tools.files.intel_hex import read_intel_hex
from taxel_tools.files.manifest import read_firmware_bytes, read_manifest

MANIFEST_SUFFIXES: Final = {".toml", ".json"}


def load_firmware(paths: Sequence[Path]) -> Firmware:
    """Read firmware files: `.cyacd`, `.hex`, `.bin` (an image with its header) and manifests; at most one image per
    slot.

    Raises `FirmwareFileError` for damaged, contradicting or too large files and for pipes and devices, OSError for a
    file that cannot be read.
    """
    images: list[FirmwareImage] = []
    for path in paths:
        data = read_firmware_bytes(path)
        images += read_manifest(path, data, _read_one) if path.suffix in MANIFEST_SUFFIXES else [_read_one(path, data)]
    first = images[0]
    for image in images[1:]:
        if image.device != first.device:
            raise FirmwareFileError(
                image.source,
                "image device",
                f"{first.device.name.lower()}, as in {first.source}",
                image.device.name.lower(),
                "flash boards and the hub with separate commands",
            )
        for field in ("kind", "version"):
            expected, found = getattr(first, field), getattr(image, field)
            if expected != found:
                raise FirmwareFileError(
                    image.source, f"image {field}", f"{expected}, as in {first.source}", f"{found}", "use one version"
                )
    for slot in (0, 1):
        slot_images = [image for image in images if image.slot == slot]
        if len(slot_images) > 1:
            raise FirmwareFileError(
                slot_images[1].source,
                "image slot",
                f"one image for slot {format_slot(slot)}",
                f"a second one besides {slot_images[0].source}",
                "use one file for each slot",
            )
    return Firmware(tuple(images))


def _read_one(path: Path, data: bytes) -> FirmwareImage:
    """Read the image of one firmware file, whose format follows from its suffix. Raises `FirmwareFileError`.

    data: bytes of the file.
    """
    if path.suffix == ".bin":
        return parse_image(data, str(path))
    readers = {".cyacd": read_cyacd, ".hex": read_intel_hex, ".ihex": read_intel_hex}
    if path.suffix not in readers:
        raise FirmwareFileError(
            str(path), "file name", ".cyacd, .hex, .bin, .toml or .json", repr(path.suffix), "rename or convert it"
        )
    try:
        text = data.decode("ascii")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise FirmwareFileError(
            str(path),
            f"line {line}",
            "ASCII text",
            f"byte {data[error.start]:02X}",
            "the file is damaged; copy it again",
        ) from None
    return readers[path.suffix](text, str(path))
