"""Plant the bugs of bugs.toml, one at a time, in a copy of the repository, and see whether the suite finds each.

python tools/mutants/plant.py                    all bugs (make mutants)
python tools/mutants/plant.py --only NAME        one bug; may be given several times
python tools/mutants/plant.py --list             what there is, and that every bug can still be planted
python tools/mutants/plant.py --folder DIR       keep copies and builds there: the next run takes them up

A bug is found by the first stage of the suite that fails. The copy is of the files as they are now, new ones that git
does not ignore included; it is tested without any bug first. Exit status 0: all found; 1: a bug survived; 2: the tool
could not do its work.
"""

import argparse
import contextlib
import difflib
import json
import os
import queue
import re
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Self

ROOT = Path(__file__).resolve().parents[2]
BUGS = Path(__file__).with_name("bugs.toml")
OUT = ROOT / "out"
LONGEST_S = 900
"""A stage that takes longer hangs, and has found the bug; several times what the slowest takes without one."""

APPLY_TEST = "protocol/tests/test_protocol_mutants_apply.py"
"""Left out: it fails where a bug is planted because the bug is planted, whatever the bug does."""

WITHOUT_EDITABLE = """import sys

sys.meta_path[:] = [finder for finder in sys.meta_path if not type(finder).__module__.startswith("_editable")]
"""
"""sitecustomize.py of the copy: an editable install's import hook would win over PYTHONPATH and test the original."""

PROBE = """import importlib.resources, hil_tests, taxel, taxel_protocol
native = importlib.resources.files("taxel") / "native"
print(hil_tests.__path__[0], taxel.__file__, taxel_protocol.__file__, native / "libtaxel_codec.so", sep="\\n")
"""


class PlantError(Exception):
    """What keeps the bugs from being planted or the suite from being run, in one line."""


@dataclass(frozen=True)
class Bug:
    """`old`, which occurs exactly once in `file` (relative to the repository), becomes `new`. `what`: one line."""

    name: str
    file: str
    what: str
    old: str
    new: str

    def planted_in(self, text: str) -> str:
        """`text` of the file with the bug in it. Raises PlantError unless `old` occurs exactly once."""
        if (count := text.count(self.old)) != 1:
            raise PlantError(f"{self.name}: its text occurs {count} times in {self.file}, expected once; write it anew")
        return text.replace(self.old, self.new)


@dataclass(frozen=True)
class Stage:
    """A part of the suite. `reads`: the folders whose bugs it can see. `tests`: what pytest is asked for; none for the
    C tests, of which it is those whose names match `pattern`.
    """

    name: str
    reads: tuple[str, ...]
    tests: tuple[str, ...] = ()
    pattern: str = "."


STAGES = (
    # Those that link the firmware alone: the others take most of the time, to build and to run.
    Stage("C firmware", ("firmware/",), pattern="^(test_sensor|test_hub|test_vectors|stress_sensor|fuzz)"),
    Stage("C all", ("firmware/",)),
    Stage("cloud tests", ("host/taxel/cloud/",), ("host/tests/cloud",)),
    Stage("gap tests", ("host/taxel/gap/",), ("host/tests/gap",)),
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
"""From the cheapest to the dearest."""


@dataclass(frozen=True)
class Outcome:
    """`found_by`: the stage that failed first and `test` in it; None if the bug survived, or does not compile."""

    name: str
    file: str
    what: str
    found_by: str | None
    test: str
    seconds: float


def load_bugs(path: Path = BUGS) -> list[Bug]:
    """Every bug of the list. Raises PlantError for two of one name, or one that changes nothing."""
    bugs = [Bug(**table) for table in tomllib.loads(path.read_text())["bug"]]
    names = [bug.name for bug in bugs]
    for bug in bugs:
        if names.count(bug.name) > 1:
            raise PlantError(f"{path.name}: two bugs have the name {bug.name}")
        if bug.old == bug.new:
            raise PlantError(f"{bug.name}: changes nothing")
    return bugs


def stages_of(bug: Bug) -> list[Stage]:
    """The stages that could see it, cheapest first."""
    return [stage for stage in STAGES if bug.file.startswith(stage.reads)]


def _tool(name: str) -> str:
    beside = Path(sys.executable).with_name(name)
    return str(beside) if beside.exists() else name


def first_failure(output: str) -> str:
    """The test that failed first, out of what ctest or pytest has printed."""
    if found := re.search(r"^(?:FAILED|ERROR) (\S+\.py.*?)(?: - .*)?$", output, re.MULTILINE):
        return found[1]
    if found := re.search(r"^\s*\d+ - (\w+) \((.+)\)", output, re.MULTILINE):
        why = re.search(r"FAILED (\w+) \(\d+ checks?\)|(AddressSanitizer: [\w-]+)|runtime error: (.{1,40})", output)
        return f"{found[1]}: {next(filter(None, why.groups())) if why else found[2].lower()}"
    if found := re.search(r"line \d+ in (test_\w+)", output):  # what faulthandler prints of a dead interpreter
        return f"{found[1]}: the interpreter died"
    lines = output.strip().splitlines()
    return lines[-1] if lines else "no output"


class Lane:
    """One copy of the repository with its builds; it has one bug at a time."""

    def __init__(self, folder: Path, files: Sequence[str]) -> None:
        self.folder = folder
        self.copy = folder / "copy"
        paths = (folder / "site", self.copy / "host", self.copy / "protocol")
        # A .pyc is told from its source by seconds and size, and two bugs may share both: none is written.
        own = {"PYTHONPATH": os.pathsep.join(map(str, paths)), "PYTHONDONTWRITEBYTECODE": "1"}
        theirs = {name: value for name, value in os.environ.items() if not name.startswith("TAXEL_")}
        self._environment = theirs | own  # a variable could name a library of the original
        self._process: subprocess.Popen[bytes] | None = None
        self._fill(files)
        (folder / "site").mkdir(exist_ok=True)
        (folder / "site" / "sitecustomize.py").write_text(WITHOUT_EDITABLE)

    def _fill(self, files: Sequence[str]) -> None:
        """Make the copy like the repository; what is the same already keeps its time, so that builds go on from it."""
        wanted = {self.copy / name: ROOT / name for name in files}
        for path in self.copy.rglob("*"):
            if path.is_file() and path not in wanted:
                path.unlink()
        for path, source in wanted.items():
            if not path.exists() or path.read_bytes() != source.read_bytes():
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(source.read_bytes())
                path.chmod(source.stat().st_mode)

    def prepare(self) -> None:
        """Configure and build without a bug. Raises PlantError if that fails, or if Python would test other files."""
        ninja = [] if _tool("ninja") == "ninja" else [f"-DCMAKE_MAKE_PROGRAM={_tool('ninja')}"]
        configure = [_tool("cmake"), "-G", "Ninja", *ninja]
        tests = ["-DTAXEL_BUILD_TESTS=ON", "-DTAXEL_SANITIZE=ON", "-DCMAKE_BUILD_TYPE=RelWithDebInfo"]
        package = ["-DTAXEL_INSTALL_PYTHON=ON", f"-DCMAKE_INSTALL_PREFIX={self.copy / 'host'}"]
        self._must([*configure, "-S", str(self.copy / "firmware"), "-B", str(self.folder / "tests"), *tests])
        self._must([*configure, "-S", str(self.copy), "-B", str(self.folder / "package"), *package])
        for what in ("tests", "package"):
            self.build(what)
        code, output = self._run([sys.executable, "-c", PROBE])
        for line in output.splitlines():
            if code or not (Path(line).exists() and Path(line).is_relative_to(self.copy)):
                raise PlantError(f"the suite would not test the copy: {line}, expected something in {self.copy}")

    def build(self, what: str, *programs: str) -> None:
        """Bring a build up to date; the package's libraries go to where the copy looks for them."""
        goals = ["--target", *programs] if programs else []
        self._must([_tool("cmake"), "--build", str(self.folder / what), "-j", "1", *goals])
        if what == "package":
            self._must([_tool("cmake"), "--install", str(self.folder / what)])

    def _c_tests(self, stage: Stage) -> list[str]:
        """Build the C tests of a stage; the command that runs them."""
        folder = self.folder / "tests"
        ctest = [_tool("ctest"), "--test-dir", str(folder), "-R", stage.pattern, "--no-tests=error"]
        code, output = self._run([*ctest, "--show-only=json-v1"])
        if code:
            raise PlantError(f"{stage.name}: {first_failure(output)}")
        programs = [Path(test["command"][0]) for test in json.loads(output[output.index("{") :])["tests"]]
        self.build("tests", *(str(program.relative_to(folder)) for program in programs))
        return [*ctest, "--output-on-failure", "--stop-on-failure"]

    def failure(self, stage: Stage, file: str = "") -> str | None:
        """Run a stage: its first failing test, None if all pass. Raises PlantError if the C sources do not compile.

        `file`: where the bug is; the tests of its own package come first.
        """
        if stage.tests:
            self.build("package")
            command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "--tb=short"]
            command += sorted(stage.tests, key=lambda tests: Path(tests).stem not in file)
        else:
            command = self._c_tests(stage)
        code, output = self._run(command)
        (self.folder / f"{stage.name}.log").write_text(output)
        if code is None:
            return f"nothing for {LONGEST_S} s"
        return first_failure(output) if code else None

    def try_bug(self, bug: Bug) -> Outcome:
        """Plant it, run the suite until a stage fails, and take it out again."""
        path = self.copy / bug.file
        text = path.read_text()
        begin = time.monotonic()
        found_by, test = None, ""
        path.write_text(bug.planted_in(text))
        try:
            for stage in stages_of(bug):
                if failure := self.failure(stage, bug.file):
                    found_by, test = stage.name, failure
                    break
        except PlantError as error:
            test = f"cannot be tested: {error}"
        finally:
            path.write_text(text)
        return Outcome(bug.name, bug.file, bug.what, found_by, test, round(time.monotonic() - begin, 1))

    def _must(self, command: list[str]) -> None:
        code, output = self._run(command)
        if code:
            errors = [line for line in output.splitlines() if re.search(r"\b[Ee]rror\b[: ]", line)]
            raise PlantError(f"{Path(command[0]).name} failed: {(errors or [output.strip()[-200:]])[0]}")

    def _run(self, command: list[str]) -> tuple[int | None, str]:
        """Exit status (None: it hung, and was ended with all that it had started) and output."""
        with tempfile.TemporaryFile() as output:
            self._process = subprocess.Popen(
                command, cwd=self.copy, env=self._environment, stdout=output, stderr=subprocess.STDOUT,
                start_new_session=True,
            )  # fmt: skip
            code: int | None = None
            with contextlib.suppress(subprocess.TimeoutExpired):
                code = self._process.wait(LONGEST_S)
            self.end_what_runs()
            output.seek(0)
            return code, output.read().decode(errors="replace")

    def end_what_runs(self) -> None:
        """End the command that runs, if any, with all that it has started."""
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()


class Lanes:
    """Copies that work side by side, each on another task."""

    def __init__(self, folder: Path, jobs: int) -> None:
        listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        listed = subprocess.run(listing, cwd=ROOT, capture_output=True, check=True).stdout.decode()
        files = [name for name in listed.split("\0") if name and (ROOT / name).is_file()]
        self._free: queue.Queue[Lane] = queue.Queue()
        self._pool = ThreadPoolExecutor(jobs)
        self._lanes = [Lane(folder / f"lane{number}", files) for number in range(jobs)]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)
        for lane in self._lanes:
            lane.end_what_runs()
        self._pool.shutdown()

    def prepare(self) -> None:
        """Build every copy. Raises PlantError."""
        list(self._pool.map(Lane.prepare, self._lanes))
        for lane in self._lanes:
            self._free.put(lane)

    def check_unharmed(self, stages: Sequence[Stage]) -> None:
        """Raises PlantError if a stage fails without any bug."""
        for stage, failure in zip(stages, self._pool.map(self._failure, stages), strict=True):
            print(f"without a bug: {stage.name}: {failure or 'pass'}", flush=True)
            if failure:
                raise PlantError(f"{stage.name} fail without any bug ({failure}); mend that first")

    def _failure(self, stage: Stage) -> str | None:
        lane = self._free.get()
        try:
            return lane.failure(stage)
        finally:
            self._free.put(lane)

    def try_all(self, bugs: Sequence[Bug]) -> list[Outcome]:
        """Outcomes in the order of the list; each is printed as it comes."""
        width = max(len(bug.name) for bug in bugs)
        return list(self._pool.map(lambda bug: self._try(bug, width), bugs))

    def _try(self, bug: Bug, width: int) -> Outcome:
        lane = self._free.get()
        try:
            outcome = lane.try_bug(bug)
        finally:
            self._free.put(lane)
        found = outcome.found_by or "SURVIVED"
        print(f"{bug.name:{width}s} {found:14s} {outcome.seconds:6.1f} s  {outcome.test}", flush=True)
        return outcome


def write_diff(bug: Bug) -> Path:
    """The bug as a patch, to be looked at or applied by hand."""
    text = (ROOT / bug.file).read_text()
    lines = (text.splitlines(keepends=True), bug.planted_in(text).splitlines(keepends=True))
    path = OUT / "mutants" / f"{bug.name}.diff"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(difflib.unified_diff(*lines, f"a/{bug.file}", f"b/{bug.file}")))
    return path


def run(bugs: Sequence[Bug], folder: Path, jobs: int) -> int:
    """Try the bugs; the exit status. Raises PlantError."""
    needed = {stage for bug in bugs for stage in stages_of(bug)}
    with Lanes(folder, jobs) as lanes:
        lanes.prepare()
        lanes.check_unharmed([stage for stage in STAGES if stage in needed])
        outcomes = lanes.try_all(bugs)
    OUT.mkdir(exist_ok=True)
    (OUT / "mutants.json").write_text(json.dumps([asdict(outcome) for outcome in outcomes], indent=1) + "\n")
    found = {outcome.name for outcome in outcomes if outcome.found_by}
    print(f"{len(found)} of {len(bugs)} bugs found")
    for bug in bugs:
        if bug.name not in found:
            print(f"survived: {bug.name} ({bug.what}); see it: git apply {write_diff(bug).relative_to(ROOT)}")
    return 0 if len(found) == len(bugs) else 1


def chosen(bugs: Sequence[Bug], names: Sequence[str]) -> list[Bug]:
    """The bugs of these names, all without any. Raises PlantError for a name that is not there or a stale text."""
    if unknown := set(names) - {bug.name for bug in bugs}:
        raise PlantError(f"there is no bug named {', '.join(sorted(unknown))}; --list shows them")
    wanted = [bug for bug in bugs if not names or bug.name in names]
    for bug in wanted:
        bug.planted_in((ROOT / bug.file).read_text())
    return wanted


def main() -> int:
    """Plant, test, print one line for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="only this bug")
    parser.add_argument("--list", action="store_true", help="print the bugs and end")
    parser.add_argument("--jobs", type=int, default=2, help="copies that work side by side (default: 2)")
    parser.add_argument("--folder", type=Path, help="where the copies lie, kept (default: a temporary folder)")
    arguments = parser.parse_args()
    try:
        bugs = chosen(load_bugs(), arguments.only)
        if arguments.list:
            for bug in bugs:
                print(f"{bug.name}: {bug.file}: {bug.what}")
            return 0
        if arguments.folder:
            return run(bugs, arguments.folder.resolve(), arguments.jobs)
        with tempfile.TemporaryDirectory(prefix="taxel-mutants-") as folder:
            return run(bugs, Path(folder).resolve(), arguments.jobs)
    except PlantError as error:
        print(f"mutants: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
