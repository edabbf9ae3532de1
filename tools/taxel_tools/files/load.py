"""Files of any form as one version of firmware."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from taxel_tools.errors import FirmwareFileError
from taxel_tools.files.cyacd import read_cyacd
from taxel_tools.files.firmware import Firmware, FirmwareImage, parse_image, slot_name
from taxel_tools.files.intel_hex import read_intel_hex
from taxel_tools.files.manifest import read_manifest

MANIFESTS: Final = {".toml", ".json"}
SIZE_MAX: Final = 1 << 20
"""Bytes of a file: a `.cyacd` of a slot has 27,000."""


def load_firmware(paths: Sequence[Path]) -> Firmware:
    """Read `.cyacd`, `.hex`, `.bin` (an image with its header) and manifests; together at most one image a slot.

    Raises `FirmwareFileError` with a line for each kind of damage, OSError for a file that cannot be read.
    """
    images: list[FirmwareImage] = []
    for path in paths:
        data = _bytes(path)
        images += read_manifest(path, data, _read_one) if path.suffix in MANIFESTS else [_read_one(path, data)]
    first = images[0]
    for image in images[1:]:
        if image.device != first.device:
            raise FirmwareFileError(
                image.source,
                "image device",
                f"{first.device.name.lower()}, as in {first.source}",
                image.device.name.lower(),
                "flash boards and the hub one after the other",
            )
        for field in ("kind", "version"):
            ours, theirs = getattr(first, field), getattr(image, field)
            if ours != theirs:
                raise FirmwareFileError(
                    image.source, f"image {field}", f"{ours}, as in {first.source}", f"{theirs}", "give one version"
                )
    for slot in (0, 1):
        same = [image for image in images if image.slot == slot]
        if len(same) > 1:
            raise FirmwareFileError(
                same[1].source,
                "image slot",
                f"one image for slot {slot_name(slot)}",
                f"another one, beside {same[0].source}",
                "give one file a slot",
            )
    return Firmware(tuple(images))


def _bytes(path: Path) -> bytes:
    with path.open("rb") as file:
        data = file.read(SIZE_MAX + 1)
    if len(data) > SIZE_MAX:
        raise FirmwareFileError(str(path), "file", f"at most {SIZE_MAX} bytes", "more", "is this a firmware file?")
    return data


def _read_one(path: Path, data: bytes) -> FirmwareImage:
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
            str(path), f"line {line}", "ASCII text", f"byte {data[error.start]:02X}", "the file is damaged; copy it"
        ) from None
    return readers[path.suffix](text, str(path))
