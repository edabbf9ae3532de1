"""Firmware images for processors that execute ARM code, built as `make firmware` builds them."""

import fcntl
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Final

from hil_tests.harness.errors import RigError

ROOT: Final = Path(__file__).parents[3]
PORT: Final = ROOT / "firmware" / "boards" / "psoc4200"
BUILD: Final = ROOT / "build" / "psoc4200"
BUILD_TOOLS: Final = ("arm-none-eabi-gcc", "cmake", "ninja")


def find_missing_tool() -> str | None:
    """Return the name of the first build tool that is not installed; None if all are installed."""
    return next((name for name in BUILD_TOOLS if _find_program(name) is None), None)


def _find_program(name: str) -> str | None:
    """Find a build program beside the Python interpreter or, if it is not there, in the search path.

    Returns None if it is not installed.
    """
    beside_python = shutil.which(name, path=str(Path(sys.executable).parent))  # the Makefile uses these first
    return beside_python or shutil.which(name)


@cache
def build_images() -> Path:
    """Build board-factory.hex and hub-factory.hex, and return their folder.

    Raises `RigError` with a one-line message.
    """
    missing = find_missing_tool()
    if missing:
        raise RigError(f"the rig executes images, whose build needs {missing}; install it, or use --rig virtual")
    BUILD.mkdir(parents=True, exist_ok=True)
    with (BUILD / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # parallel test processes share the build folder
        _run_build()
    return BUILD / "images"


def _run_build() -> None:
    """Configure and run the cross build. Raises `RigError` with the last line of its output."""
    cmake, ninja = _find_program("cmake"), _find_program("ninja")
    configure = [f"-DCMAKE_TOOLCHAIN_FILE={PORT / 'toolchain.cmake'}", f"-DTAXEL_PYTHON={sys.executable}"]
    for arguments in (
        ["-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={ninja}", *configure, "-S", str(PORT), "-B", str(BUILD)],
        ["--build", str(BUILD)],
    ):
        result = subprocess.run([str(cmake), *arguments], capture_output=True, text=True)
        if result.returncode:
            output = (result.stdout + result.stderr).strip().splitlines()
            reason = output[-1] if output else "no output"
            raise RigError(f"the images for the rig cannot be built (make firmware): {reason}")
