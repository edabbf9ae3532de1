"""A manifest names the files of one version: both slots, and the properties of raw images without a header.

    taxel_firmware = 1

    [[image]]
    file = "fingertip-1.2.0-a.cyacd"      # in the folder of the manifest
    sha256 = "9f86d081..."                # optional

    [[image]]
    file = "fingertip-1.2.0-b.bin"        # raw image from the vector table on: the next four keys are required
    device = "board"                      # or "hub"
    kind = 1                              # 0: any
    slot = "B"
    version = "1.2.0"

The four keys are optional for other files; the values must then agree with the header of the image. JSON with the same
structure is accepted too.
"""

import hashlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NoReturn

from taxel.hand.errors import format_value
from taxel.input_files import InputFileError, TextError, parse_json, parse_toml, read_regular_file
from taxel_protocol.bootloader import BOOT_IMAGE_MAGIC, BootDevice
from taxel_protocol.bootloader_images import build_image
from taxel_tools.errors import FirmwareFileError
from taxel_tools.files.firmware import FirmwareImage, format_slot, parse_image

SIZE_MAX: Final = 1 << 20
"""Size limit of a file in bytes; a `.cyacd` file of one slot has 27,000."""
IMAGES_MAX: Final = 2
"""Largest number of images of a manifest: one for each slot."""
NAME_LENGTH_MAX: Final = 255
"""Largest number of characters of a file name; Linux permits 255 bytes."""
KEYS: Final = {"file", "sha256", "device", "kind", "slot", "version"}
DEVICE_NAMES: Final = {device.name.lower(): device for device in BootDevice}

ReadOne = Callable[[Path, bytes], FirmwareImage]


def read_firmware_bytes(path: Path) -> bytes:
    """Read the content of a firmware file.

    Raises `FirmwareFileError` unless it is a regular file of at most `SIZE_MAX` bytes, and OSError.
    """
    try:
        return read_regular_file(path, SIZE_MAX)
    except InputFileError as error:
        raise FirmwareFileError(
            str(path), "file", f"a regular file of at most {SIZE_MAX} bytes", "another", "is this a firmware file?"
        ) from error


def read_manifest(path: Path, data: bytes, read_one: ReadOne) -> list[FirmwareImage]:
    """Read the firmware images that a manifest lists.

    data: bytes of the manifest. read_one: reads an image file that has a header. Raises `FirmwareFileError`, OSError.
    """
    document = _parse_document(path, data)
    version = document.get("taxel_firmware")
    if type(version) is not int or version != 1:  # in Python, True == 1 and 1.0 == 1
        _fail(path, "taxel_firmware", "1", format_value(version), "is this a firmware manifest?")
    entries = document.get("image")
    if not isinstance(entries, list) or not entries or not all(isinstance(entry, dict) for entry in entries):
        _fail(path, "image", "one table or more", "none", "add an [[image]] table for each file")
    if len(entries) > IMAGES_MAX:
        _fail(path, "image", f"at most {IMAGES_MAX} tables", str(len(entries)), "keep one image for each slot")
    unknown = sorted(set(document) - {"taxel_firmware", "image"})
    if unknown:
        _fail(path, unknown[0], "taxel_firmware or image", "an unknown key", "correct its name")
    return [_read_image(path, f"image[{i}]", entry, read_one) for i, entry in enumerate(entries)]


def _parse_document(path: Path, data: bytes) -> dict[str, Any]:
    """Parse the JSON or TOML text of a manifest. Raises `FirmwareFileError` for invalid text.

    data: bytes of the manifest; the suffix of `path` selects the format.
    """
    try:
        document = parse_json(data) if path.suffix == ".json" else parse_toml(data)
    except TextError as error:
        _fail(path, error.position, error.expected, error.found, "correct the file")
    if not isinstance(document, dict):
        _fail(path, "file", "a table", "something else", "see docs/how-to-flash-boards.md")
    return document


def _fail(path: Path, field: str, expected: str, found: str, remedy: str) -> NoReturn:
    """Raise `FirmwareFileError` for a field of a manifest."""
    raise FirmwareFileError(str(path), field, expected, found, remedy)


def _read_image(path: Path, field: str, entry: dict[str, Any], read_one: ReadOne) -> FirmwareImage:
    """Read the firmware image of one manifest entry, and check the hash and the properties that the entry states.

    field: position of the entry, such as "image[0]". Raises `FirmwareFileError`.
    """
    unknown = sorted(set(entry) - KEYS)
    if unknown:
        _fail(path, f"{field}.{unknown[0]}", f"one of {', '.join(sorted(KEYS))}", "an unknown key", "correct its name")
    name = entry.get("file")
    if not isinstance(name, str) or not name.isprintable() or not 0 < len(name) <= NAME_LENGTH_MAX:
        _fail(
            path, f"{field}.file", f"a file name of at most {NAME_LENGTH_MAX} characters", format_value(name), "add it"
        )
    file = path.parent / name
    data = read_firmware_bytes(file)
    expected_hash = entry.get("sha256")
    actual_hash = hashlib.sha256(data).hexdigest()
    if expected_hash is not None and str(expected_hash).lower() != actual_hash:
        _fail(
            path,
            f"{field}.sha256",
            str(expected_hash),
            actual_hash,
            f"{name} is damaged or of another build; copy it again",
        )
    has_no_header = file.suffix == ".bin" and not data.startswith(BOOT_IMAGE_MAGIC.to_bytes(4, "little"))
    result = _add_header(path, field, entry, file, data) if has_no_header else read_one(file, data)
    _check_claims(path, field, entry, result)
    return result


def _add_header(path: Path, field: str, entry: dict[str, Any], file: Path, data: bytes) -> FirmwareImage:
    """Build a firmware image from a raw image without header, and the header values in its manifest entry.

    path: manifest. field: position of the entry. file, data: name and bytes of the raw image. Raises
    `FirmwareFileError`.
    """
    for key in ("device", "kind", "slot", "version"):
        if key not in entry:
            _fail(path, f"{field}.{key}", "a value, as the raw image has no header", "none", f"add {key}")
    claims = _parse_claims(path, field, entry)
    try:
        return parse_image(
            build_image(claims["device"], claims["slot"], claims["kind"], claims["version"], data), str(file)
        )
    except ValueError as error:
        if isinstance(error, FirmwareFileError):
            raise
        _fail(path, f"{field}.file", "an image that fits the slot", str(error), "reduce the image size")


def _parse_claims(path: Path, field: str, entry: dict[str, Any]) -> dict[str, Any]:
    """Parse device, kind, slot and version that a manifest entry states; keys that it lacks are omitted.

    Raises `FirmwareFileError` for an invalid value.
    """
    claims: dict[str, Any] = {}
    if "device" in entry:
        if not isinstance(entry["device"], str) or entry["device"] not in DEVICE_NAMES:
            _fail(path, f"{field}.device", " or ".join(DEVICE_NAMES), format_value(entry["device"]), "correct it")
        claims["device"] = DEVICE_NAMES[entry["device"]]
    if "kind" in entry:
        kind = entry["kind"]
        if not isinstance(kind, int) or isinstance(kind, bool) or not 0 <= kind <= 255:
            _fail(path, f"{field}.kind", "0 to 255", format_value(kind), "correct it")
        claims["kind"] = kind
    if "slot" in entry:
        if entry["slot"] not in ("A", "B"):
            _fail(path, f"{field}.slot", "A or B", format_value(entry["slot"]), "correct it")
        claims["slot"] = "AB".index(entry["slot"])
    if "version" in entry:
        match = re.fullmatch(r"(\d{1,3})\.(\d{1,3})\.(\d{1,3})", str(entry["version"]))
        if not match or any(int(part) > 255 for part in match.groups()):
            _fail(path, f"{field}.version", "three numbers such as 1.2.0", format_value(entry["version"]), "correct it")
        claims["version"] = tuple(int(part) for part in match.groups())
    return claims


def _check_claims(path: Path, field: str, entry: dict[str, Any], loaded_image: FirmwareImage) -> None:
    """Compare the properties that a manifest entry states with the image.

    Raises `FirmwareFileError` for a difference.
    """
    formatters: dict[str, Callable[[Any], str]] = {
        "slot": format_slot,
        "version": lambda version: ".".join(map(str, version)),
        "device": lambda device: device.name.lower(),
    }
    for key, claim in _parse_claims(path, field, entry).items():
        value = getattr(loaded_image, key)
        if value != claim:
            text = formatters.get(key, str)
            _fail(
                path,
                f"{field}.{key}",
                text(claim),
                f"{text(value)} in {loaded_image.source}",
                "correct the manifest or the file",
            )
