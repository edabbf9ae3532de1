"""The list of bugs, and the stages of the test suite that can detect each bug."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUGS = Path(__file__).with_name("bugs.toml")

APPLY_TEST = "protocol/tests/test_protocol_mutants_apply.py"
"""Excluded, because this test fails for every planted bug regardless of its effect."""


class PlantError(Exception):
    """The bugs cannot be planted or the suite cannot run; the message is one line."""


@dataclass(frozen=True)
class Bug:
    """A bug: `old`, which occurs exactly once in `file` (relative to the repository), is replaced by `new`. what: one
    line.
    """

    name: str
    file: str
    what: str
    old: str
    new: str

    def plant_in(self, text: str) -> str:
        """Return `text` of the file with the bug. Raises PlantError unless `old` occurs exactly once."""
        if (count := text.count(self.old)) != 1:
            found = f"its text occurs {count} times in {self.file}, expected once"
            raise PlantError(f"{self.name}: {found}; update it in bugs.toml")
        return text.replace(self.old, self.new)


@dataclass(frozen=True)
class Stage:
    """A part of the suite.

    covers: folders whose bugs the stage can detect. tests: arguments of pytest; empty for C tests, which are selected
    by `pattern`.
    """

    name: str
    covers: tuple[str, ...]
    tests: tuple[str, ...] = ()
    pattern: str = "."


STAGES = (
    # Tests that link the firmware only; the other C tests take most of the time to build and run.
    Stage("C firmware", ("firmware/",), pattern="^(test_sensor|test_hub|test_vectors|stress_sensor|fuzz)"),
    Stage("C all", ("firmware/",)),
    Stage("dynamics tests", ("firmware/emulator/dynamics/",), ("host/tests/campaign/test_dynamics_reference.py",)),
    Stage(
        "bring-up tests",
        ("firmware/emulator/psoc4/", "firmware/boards/psoc4200/bringup/", "tools/taxel_tools/bringup/"),
        ("host/tests/firmware_images/test_firmware_images_bringup.py",),
    ),
    Stage(
        "tests of executed images",
        ("firmware/boards/psoc4/", "firmware/boards/psoc4100s/"),
        ("--rig=psoc4100s", "hil_tests/test_hil_cortex_m0.py", "hil_tests/test_hil_power.py"),
    ),
    Stage("protocol tests", ("firmware/codec/", "protocol/"), ("protocol/tests", f"--ignore={APPLY_TEST}")),
    Stage(
        "host tests",
        ("firmware/", "protocol/", "host/"),
        ("host/tests/stream", "host/tests/signal", "host/tests/link", "host/tests/skin"),
    ),
    Stage(
        "hil tests",
        ("firmware/", "protocol/", "host/", "hil_tests/"),
        ("hil_tests", "--ignore=hil_tests/test_hil_physical.py"),
    ),
)
"""In ascending order of duration. The tests of the bug's own package in `host/taxel` come before them."""


def load_bugs(path: Path = BUGS) -> list[Bug]:
    """Read the list of bugs. Raises PlantError for a duplicate name or a bug that changes nothing."""
    bugs = [Bug(**table) for table in tomllib.loads(path.read_text())["bug"]]
    names = [bug.name for bug in bugs]
    for bug in bugs:
        if names.count(bug.name) > 1:
            raise PlantError(f"{path.name}: two bugs have the name {bug.name}")
        if bug.old == bug.new:
            raise PlantError(f"{bug.name}: changes nothing")
    return bugs


def select_stages(bug: Bug) -> list[Stage]:
    """Return the test stages that can detect the bug, in the order in which they run.

    The tests of the bug's own package in `host/taxel` come first, if there are any; then the `STAGES` that cover the
    file of the bug, in ascending order of duration.
    """
    package_stage = make_package_stage(bug.file)
    others = [stage for stage in STAGES if bug.file.startswith(stage.covers)]
    return others if package_stage is None else [package_stage, *others]


def make_package_stage(file: str) -> Stage | None:
    """Build the stage that runs the tests of a source file's package in `host/taxel`.

    file: path in the repository, such as "host/taxel/gap/fitting/fit.py", whose tests are in host/tests/gap. Test files
    that import the module come first. Returns None for a file outside the packages of `host/taxel`, and for a package
    without tests.
    """
    parts = Path(file).parts
    if parts[:2] != ("host", "taxel") or len(parts) < 4:
        return None
    package = Path("host", "tests", parts[2])
    files = sorted((ROOT / package).glob("test_*.py"))
    module = ".".join(Path(file).with_suffix("").parts[1:])
    files.sort(key=lambda path: module not in path.read_text())
    tests = tuple(str(path.relative_to(ROOT)) for path in files)
    return Stage(f"{parts[2]} tests", (str(package),), tests) if tests else None


def select_bugs(bugs: Sequence[Bug], names: Sequence[str]) -> list[Bug]:
    """Select bugs by name (all if no name is given). Raises PlantError for an unknown name or a stale text."""
    if unknown := set(names) - {bug.name for bug in bugs}:
        raise PlantError(f"unknown bug {', '.join(sorted(unknown))}; --list shows the names")
    selected = [bug for bug in bugs if not names or bug.name in names]
    for bug in selected:
        bug.plant_in((ROOT / bug.file).read_text())
    return selected
