"""The images that a rig with executed processors runs: built as `make firmware` builds them, once."""

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


def missing_tool() -> str | None:
    """What is not there of what a build needs; None: it can be done."""
    return next((name for name in ("arm-none-eabi-gcc", "cmake", "ninja") if _found(name) is None), None)


def _found(name: str) -> str | None:
    return shutil.which(name, path=str(Path(sys.executable).parent)) or shutil.which(name)  # the Makefile's first


@cache
def images() -> Path:
    """The folder with board-factory.hex and hub-factory.hex, up to date. Raises `RigError`, one line."""
    missing = missing_tool()
    if missing:
        raise RigError(f"the rig executes images, which need {missing} to be built; install it, or use --rig virtual")
    BUILD.mkdir(parents=True, exist_ok=True)
    with (BUILD / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # test processes that run side by side build in one folder
        _build()
    return BUILD / "images"


def _build() -> None:
    cmake, ninja = _found("cmake"), _found("ninja")
    configure = [f"-DCMAKE_TOOLCHAIN_FILE={PORT / 'toolchain.cmake'}", f"-DTAXEL_PYTHON={sys.executable}"]
    for arguments in (
        ["-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={ninja}", *configure, "-S", str(PORT), "-B", str(BUILD)],
        ["--build", str(BUILD)],
    ):
        done = subprocess.run([str(cmake), *arguments], capture_output=True, text=True)
        if done.returncode:
            words = (done.stdout + done.stderr).strip().splitlines()
            why = words[-1] if words else "no word"
            raise RigError(f"the images for the rig cannot be built (make firmware): {why}")
