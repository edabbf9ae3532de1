"""Fixtures: the images as built by `make firmware`, and the modules of tools/firmware."""

import fcntl
import importlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from taxel_protocol.bootloader import (
    BOOT_CONFIGURATION_MAGIC,
    BOOT_CONFIGURATION_ROW,
    BOOT_METADATA_MAGIC,
    BOOT_METADATA_ROW,
    BOOT_ROW_SIZE,
    LAYOUTS,
    BootDevice,
)
from taxel_protocol.bootloader_images import build_record

DEVICES = {"board": BootDevice.BOARD, "hub": BootDevice.HUB}
ROOT = Path(__file__).resolve().parents[3]
NONE = 0xFF
"""Value of a slot field of a metadata record that names no slot."""
PORT = ROOT / "firmware" / "boards" / "psoc4200"
FOLDER = ROOT / "tools" / "firmware"
MODULES = (
    "board_header",
    "firmware_elf",
    "firmware_image",
    "firmware_size",
    "firmware_stack",
    "import_pins",
    "original_flash",
    "original_image",
)


def make_metadata(confirmed: int, pending: int, tries: tuple[int, int]) -> bytes:
    """Create the content of a metadata record.

    confirmed, pending: a slot (0 or 1) or NONE. tries: remaining boot attempts of slots A and B.
    """
    return bytes([confirmed, pending, *tries])


@pytest.fixture(scope="session")
def tools():
    """The modules of tools/firmware."""
    sys.path.insert(0, str(FOLDER))
    yield SimpleNamespace(**{name: importlib.import_module(name) for name in MODULES})
    while str(FOLDER) in sys.path:
        sys.path.remove(str(FOLDER))


@pytest.fixture(scope="session")
def build_images() -> Callable[..., Path]:
    """Function that builds targets in a folder. Skips the test if the cross compiler is missing."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    executables = {name: shutil.which(name, path=path) for name in ("arm-none-eabi-gcc", "cmake", "ninja")}
    missing = [name for name, executable in executables.items() if executable is None]
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed: apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi")

    def run(*arguments: str) -> None:
        """Run CMake with these arguments; it must succeed."""
        completed = subprocess.run([str(executables["cmake"]), *arguments], capture_output=True, text=True)
        assert completed.returncode == 0, completed.stdout[-2000:] + completed.stderr[-2000:]

    def build(folder: Path, *targets: str, options: tuple[str, ...] = ()) -> Path:
        """Configure and build targets (none: all) in a folder, and return the folder.

        A lock lets several processes of the test run build in the same folder one after another.
        """
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / ".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            toolchain = f"-DCMAKE_TOOLCHAIN_FILE={PORT / 'toolchain.cmake'}"
            ninja = ("-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={executables['ninja']}")
            run(*ninja, "-S", str(PORT), "-B", str(folder), toolchain, f"-DTAXEL_PYTHON={sys.executable}", *options)
            run("--build", str(folder), *(("--target", *targets) if targets else ()))
        return folder

    return build


@pytest.fixture(scope="session")
def build_folder(build_images) -> Path:
    """Up-to-date build folder of `make firmware`."""
    return build_images(ROOT / "build" / "psoc4200")


@pytest.fixture(scope="session")
def flash_with(build_folder, tools) -> Callable[..., bytes]:
    """Function that composes a flash from a bootloader, the images of some slots, and records."""

    def build_flash(device: str, slots: str = "a", metadata: bytes = b"", configuration: bytes = b"") -> bytes:
        """Compose the flash of a device ("board" or "hub").

        slots: letters of the slots that contain their image. metadata, configuration: contents of these records; b""
        for no record.
        """
        flash = bytearray(0x8000)
        boot = tools.firmware_elf.read_linked_image(build_folder / f"bootloader-{device}.elf").content
        flash[: len(boot)] = boot
        for slot in slots:
            data = (build_folder / "images" / f"{device}-{slot}.bin").read_bytes()
            first_byte = LAYOUTS[DEVICES[device]].slot_address("ab".index(slot))
            flash[first_byte : first_byte + len(data)] = data
        for row, magic, content in (
            (BOOT_METADATA_ROW, BOOT_METADATA_MAGIC, metadata),
            (BOOT_CONFIGURATION_ROW, BOOT_CONFIGURATION_MAGIC, configuration),
        ):
            if content:
                flash[row * BOOT_ROW_SIZE : (row + 1) * BOOT_ROW_SIZE] = build_record(magic, 1, content)
        return bytes(flash)

    return build_flash
