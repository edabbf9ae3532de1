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
PORTS: Final = ROOT / "firmware" / "boards"
BUILDS: Final = ROOT / "build"
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
def build_images(part: str = "psoc4200") -> Path:
    """Build board-factory.hex and hub-factory.hex of a microcontroller, and return their folder.

    part: folder of the port in firmware/boards. Raises `RigError` with a one-line message.
    """
    missing = find_missing_tool()
    if missing:
        raise RigError(f"the rig executes images, whose build needs {missing}; install it, or use --rig virtual")
    build = BUILDS / part
    build.mkdir(parents=True, exist_ok=True)
    with (build / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # parallel test processes share the build folder
        _run_build(PORTS / part, build)
    return build / "images"


def _run_build(port: Path, build: Path) -> None:
    """Configure and run the cross build of a port. Raises `RigError` with the last line of its output."""
    cmake, ninja = _find_program("cmake"), _find_program("ninja")
    configure = [f"-DCMAKE_TOOLCHAIN_FILE={port / 'toolchain.cmake'}", f"-DTAXEL_PYTHON={sys.executable}"]
    for arguments in (
        ["-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={ninja}", *configure, "-S", str(port), "-B", str(build)],
        ["--build", str(build)],
    ):
        result = subprocess.run([str(cmake), *arguments], capture_output=True, text=True)
        if result.returncode:
            output = (result.stdout + result.stderr).strip().splitlines()
            reason = output[-1] if output else "no output"
            raise RigError(f"the images for the rig cannot be built (make firmware): {reason}")
