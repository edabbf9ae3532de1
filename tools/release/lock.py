"""Write `constraints.txt`: the version of every package of a new development environment.

A new virtual environment with the newest versions that the bounds of pyproject.toml permit is made, and `pip freeze`
lists it. `make install` passes the file to `pip install --constraint`, so that every developer and the continuous
integration have the same versions. `taxel` itself is not in the list, and no host name of a package registry.
"""

import argparse
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
BUILD_PACKAGES: Final = ("scikit-build-core", "cmake", "ninja")
"""What `make install` installs before the project, because the project is built without an isolated environment."""


def main() -> int:
    """Write constraints.txt, the versions of a new development environment.

    The exit status is 1 if an installation failed or a version is not pinned.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "constraints.txt", help="file (default: constraints.txt)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="taxel-lock-") as folder:
        python = str(Path(folder) / "bin" / "python")
        pip = [python, "-m", "pip", "--disable-pip-version-check"]
        try:
            subprocess.run([sys.executable, "-m", "venv", folder], check=True)
            subprocess.run([*pip, "install", "--quiet", *BUILD_PACKAGES], check=True)
            subprocess.run([*pip, "install", "--quiet", "--no-build-isolation", f"{ROOT}[test]"], check=True)
            frozen = subprocess.run([*pip, "freeze", "--exclude", "taxel"], check=True, capture_output=True, text=True)
        except subprocess.CalledProcessError as error:
            print(f"lock: '{' '.join(error.cmd)}' failed with status {error.returncode}", file=sys.stderr)
            return 1
    lines = sorted(frozen.stdout.splitlines(), key=str.lower)
    unpinned = [line for line in lines if "==" not in line or "@" in line]
    if unpinned:
        print(f"lock: expected name==version, found {unpinned[0]!r}; nothing written", file=sys.stderr)
        return 1
    version = ".".join(platform.python_version_tuple()[:2])
    header = f"# Versions of a development environment, written by `make lock` with Python {version}. Do not edit.\n"
    arguments.out.write_text(header + "".join(f"{line}\n" for line in lines))
    print(f"{arguments.out}: {len(lines)} packages")
    return 0


if __name__ == "__main__":
    sys.exit(main())
