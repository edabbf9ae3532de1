"""Install a wheel in an empty environment, as a new user would, and run it there.

The environment has no compiler, no repository and no other package. With the light core: version, record, replay,
monitor, number and size of the installed packages, and the message of each command that needs an extra. With
`--extra gap`: an environment with the extra `sim` records a campaign of a few grasps on both sides, and a second
environment with the extra `gap` alone diagnoses it.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

MOST_MEGABYTES: Final = 100.0
MOST_PACKAGES: Final = 12
"""Limits of the light core, from the requirements of release 0.2.0."""

CORE_COMMANDS: Final[tuple[tuple[str, ...], ...]] = (
    ("--version",),
    ("--help",),
    ("record", "emulator:?speed=max", "--seconds", "2", "--out", "skin.bin"),
    ("replay", "skin.bin"),
    ("monitor", "file:skin.bin", "--once", "--baseline-frames", "20"),
    ("convert", "skin.bin", "skin.csv"),
    ("scan", "emulator:"),
    ("ros", "--help"),
    ("provision", "--help"),
    ("flash", "--help"),
    ("bench", "--help"),
    ("emulate", "--help"),
    ("feel", "--help"),
)
EXTRA_COMMANDS: Final[dict[tuple[str, ...], str]] = {
    ("grasp", "--help"): "sim",
    ("generate", "--help"): "sim",
    ("show", "--help"): "sim",
    ("import", "--help"): "sim",
    ("gap", "--help"): "gap",
    ("cloud", "--help"): "cloud",
    ("demo", "--help"): "all",
    ("thesis", "--help"): "all",
    ("record", "emulator:?speed=max", "--seconds", "1", "--out", "skin.mcap"): "ros",
    ("convert", "skin.bin", "skin.parquet"): "parquet",
    ("monitor", "file:skin.bin", "--web", "--port", "0"): "web",
    ("scan", "/dev/i2c-1"): "i2c",
    ("bench", "emulator:"): "bench",
    ("feel", "--out", "feel"): "plots",
}
"""Commands that must name the extra which they need."""

CAMPAIGN: Final = ("grasp", "--source", "both", "--grasps", "12", "--jobs", "2", "--out")


@dataclass
class Check:
    """One command in the environment: what was expected, and the outcome."""

    command: str
    passed: bool
    detail: str


class Environment:
    """Virtual environment that contains only a wheel and its dependencies; its PATH contains no compiler."""

    def __init__(self, folder: Path, wheel: Path, extra: str | None) -> None:
        """Create a virtual environment in `folder` and install a wheel of taxel there.

        extra: name of the optional dependencies to install; None: none.
        """
        self.folder = folder
        folder.mkdir(exist_ok=True)
        subprocess.run([sys.executable, "-m", "venv", str(folder / "venv")], check=True)
        self._bin = folder / "venv" / "bin"
        self._environment = {"PATH": str(self._bin), "HOME": str(folder), "COLUMNS": "200"}
        requirement = f"taxel[{extra}] @ {wheel.resolve().as_uri()}" if extra else str(wheel.resolve())
        pip = [str(self._bin / "python"), "-m", "pip", "install", "--quiet", "--only-binary", ":all:", requirement]
        inherited = {name: value for name, value in os.environ.items() if name.startswith("PIP_")}
        subprocess.run(pip, check=True, env={**self._environment, **inherited})

    def run(self, *command: str) -> subprocess.CompletedProcess[str]:
        """Run `taxel` with arguments in the environment's folder."""
        return subprocess.run(
            [str(self._bin / "taxel"), *command],
            cwd=self.folder,
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=600,
        )

    def installed(self) -> tuple[int, float]:
        """Return the number of installed packages without pip and setuptools, and their size in megabytes."""
        (packages,) = self._bin.parent.glob("lib/python*/site-packages")
        names = {path.name for path in packages.glob("*.dist-info")}
        counted = [name for name in names if not name.startswith(("pip-", "setuptools-"))]
        files = [path for path in packages.rglob("*") if path.is_file()]
        # setuptools consists of three folders
        others = ("pip", "setuptools", "pkg_resources", "_distutils_hack")
        own = [path for path in files if path.relative_to(packages).parts[0].split("-")[0] not in others]
        return len(counted), sum(path.stat().st_size for path in own) / 1e6


def check_core(environment: Environment) -> list[Check]:
    """Check the installed core: its commands, the messages for missing extras, and its number and size of packages."""
    checks = []
    for command in CORE_COMMANDS:
        done = environment.run(*command)
        lines = (done.stderr or done.stdout).strip().splitlines() or ["no output"]
        detail = "" if done.returncode == 0 else lines[-1]
        checks.append(Check(" ".join(command), done.returncode == 0, detail))
    for command, extra in EXTRA_COMMANDS.items():
        done = environment.run(*command)
        lines = done.stderr.strip().splitlines()
        passed = done.returncode != 0 and len(lines) == 1 and f"pip install 'taxel[{extra}]'" in lines[0]
        checks.append(Check(" ".join(command), passed, lines[-1] if lines else done.stdout[-200:]))
    packages, megabytes = environment.installed()
    checks.append(Check("installed packages", packages <= MOST_PACKAGES, f"{packages}, at most {MOST_PACKAGES}"))
    checks.append(Check("installed size", megabytes < MOST_MEGABYTES, f"{megabytes:.1f} MB, below {MOST_MEGABYTES:g}"))
    return checks


def check_diagnosis(simulating: Environment, diagnosing: Environment) -> list[Check]:
    """Simulate a campaign in one environment and diagnose it in another one; check both commands."""
    campaign = simulating.folder / "campaign"
    commands = (
        (simulating, (*CAMPAIGN, str(campaign))),
        (diagnosing, ("gap", "diagnose", str(campaign / "real.h5"), str(campaign / "sim.h5"), "--out", "gap")),
    )
    checks = []
    for environment, command in commands:
        done = environment.run(*command)
        lines = (done.stdout + done.stderr).strip().splitlines()
        checks.append(Check(" ".join(command[:2]), done.returncode == 0, lines[-1] if lines else ""))
    packages, megabytes = diagnosing.installed()
    checks.append(Check("installed with the extra 'gap'", True, f"{packages} packages, {megabytes:.1f} MB"))
    return checks


def _run_checks(folder: Path, wheel: Path, extra: str | None) -> list[Check]:
    """Check a wheel in new virtual environments below `folder`.

    extra: optional dependencies to check; None: only the core.
    """
    if extra is None:
        return check_core(Environment(folder, wheel, None))
    return check_diagnosis(Environment(folder / "sim", wheel, "sim"), Environment(folder / extra, wheel, extra))


def main() -> int:
    """Check a wheel in new virtual environments; the exit status is 1 if a check failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--extra", choices=("gap",), help="record a campaign, and diagnose it with this extra alone")
    parser.add_argument("--json", type=Path, help="write the outcome to this file")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="taxel-wheel-") as folder:
        try:
            checks = _run_checks(Path(folder), arguments.wheel, arguments.extra)
        except subprocess.CalledProcessError as error:
            print(f"{arguments.wheel}: cannot be installed (status {error.returncode})", file=sys.stderr)
            return 1
    for check in checks:
        print(f"{'passed' if check.passed else 'FAILED'}  {check.command}  {check.detail}")
    if arguments.json is not None:
        arguments.json.write_text(json.dumps([vars(check) for check in checks], indent=2))
    return 0 if all(check.passed for check in checks) else 1


if __name__ == "__main__":
    sys.exit(main())
