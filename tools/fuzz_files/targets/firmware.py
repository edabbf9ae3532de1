"""Targets: firmware images in all formats, and manifests."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Final

from fuzz_files.codec import Codec
from fuzz_files.document import Flat, flatten
from fuzz_files.firmware_codecs import Cyacd, Image, IntelHex
from fuzz_files.target import Rules, Target
from fuzz_files.text_codecs import Json, Toml
from taxel_protocol.bootloader import BOOT_ROW_SIZE, LAYOUTS, BootDevice
from taxel_protocol.bootloader_images import build_image
from taxel_tools.files import load_firmware
from taxel_tools.files.cyacd import write_cyacd
from taxel_tools.files.firmware import parse_image
from taxel_tools.files.intel_hex import write_intel_hex
from taxel_tools.swd import check_hex

SLOT_B: Final = 1
_CONTENT: Final = bytes(range(256)) * 2


def make_image(slot: int = 0) -> bytes:
    """Create the bytes of a board's firmware image."""
    return build_image(BootDevice.BOARD, slot, 1, (1, 2, 3), _CONTENT)


def _write(name: str) -> Callable[[Path], str]:
    """Return a function that writes an image to the file `name`, whose suffix selects the format."""

    def make(folder: Path) -> str:
        """Write the image and return the file's name."""
        data = make_image()
        image = parse_image(data, name)
        row = LAYOUTS[BootDevice.BOARD].slot_address(0) // BOOT_ROW_SIZE
        texts = {".cyacd": lambda: write_cyacd(image, row), ".hex": lambda: write_intel_hex(data, row * BOOT_ROW_SIZE)}
        suffix = Path(name).suffix
        (folder / name).write_bytes(texts[suffix]().encode() if suffix in texts else data)
        return name

    return make


def _write_manifest(name: str) -> Callable[[Path], str]:
    """Return a function that writes two images and the manifest `name`, in JSON or TOML."""

    def make(folder: Path) -> str:
        """Write the images and the manifest, and return the manifest's name."""
        (folder / "a.bin").write_bytes(make_image())
        (folder / "raw.bin").write_bytes(_CONTENT)
        entries = [
            {"file": "a.bin", "sha256": hashlib.sha256(make_image()).hexdigest(), "version": "1.2.3"},
            {"file": "raw.bin", "device": "board", "kind": 1, "slot": "B", "version": "1.2.3"},
        ]
        codec: Codec = Json() if name.endswith(".json") else Toml()
        (folder / name).write_bytes(codec.encode({"taxel_firmware": 1, "image": entries}))
        return name

    return make


def read_firmware(path: Path) -> Flat:
    """Read the images of a firmware file or manifest."""
    return flatten(load_firmware([path]), "", ("source",))


def read_swd_rows(path: Path) -> Flat:
    """Read the flash rows of a file for programming a blank board over SWD."""
    return {"rows": str(check_hex(path))}


_IMAGE: Final = Rules(derived=re.compile(r"#$|magic|length|vectors|program|reserved|data|row|address|type|array|head"))
_MANIFEST: Final = Rules(derived=re.compile(r"#$|file|sha256|version|device|slot|kind|taxel_firmware"))

TARGETS: Final = (
    Target("image", _write("a.bin"), ((r"\.bin$", (Image(),)),), read_firmware, 8.0, _IMAGE),
    Target("cyacd", _write("a.cyacd"), ((r"\.cyacd$", (Cyacd(),)),), read_firmware, 6.0, _IMAGE),
    Target("intel-hex", _write("a.hex"), ((r"\.hex$", (IntelHex(),)),), read_firmware, 4.0, _IMAGE),
    Target(
        "manifest",
        _write_manifest("m.toml"),
        ((r"\.toml$", (Toml(),)),),
        read_firmware,
        6.0,
        _MANIFEST,
        mutable=r"\.toml$",
    ),
    Target(
        "json-manifest",
        _write_manifest("m.json"),
        ((r"\.json$", (Json(),)),),
        read_firmware,
        6.0,
        _MANIFEST,
        mutable=r"\.json$",
    ),
)
