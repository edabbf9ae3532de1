"""Copies of the repository, isolated from the original, in which one bug at a time is planted, built and tested."""

import contextlib
import json
import os
import queue
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from bugs import ROOT, Bug, PlantError, Stage, select_stages

STAGE_TIMEOUT_S = 900
"""Time limit of a stage. A stage that exceeds it counts as hung and has detected the bug; several times the duration
of the slowest stage without a bug.
"""

WITHOUT_EDITABLE = """import sys

sys.meta_path[:] = [finder for finder in sys.meta_path if not type(finder).__module__.startswith("_editable")]
"""
"""sitecustomize.py of the copy: the import hook of an editable install takes precedence over PYTHONPATH and would test
the original."""

PROBE = """import importlib.resources, hil_tests, taxel, taxel_protocol, taxel_tools
native = importlib.resources.files("taxel") / "native"
packages = (taxel, taxel_protocol, taxel_tools)
print(hil_tests.__path__[0], *(each.__file__ for each in packages), native / "libtaxel_codec.so", sep="\\n")
"""


@dataclass(frozen=True)
class Outcome:
    """Result of a bug.

    found_by: name of the first stage that failed; None if the bug survived or cannot be tested. test: the failing test,
    or why the bug cannot be tested.
    """

    name: str
    file: str
    what: str
    found_by: str | None
    test: str
    seconds: float


def _find_tool(name: str) -> str:
    """Return the path of a build program next to the Python interpreter, or its name if it is not there."""
    local_tool = Path(sys.executable).with_name(name)
    return str(local_tool) if local_tool.exists() else name


def find_first_failure(output: str) -> str:
    """Return the first failing test in the output of ctest or pytest, with the reason of a C test.

    Returns the last line of other output.
    """
    if match := re.search(r"^(?:FAILED|ERROR) (\S+\.py.*?)(?: - .*)?$", output, re.MULTILINE):
        return match[1]
    if match := re.search(r"^\s*\d+ - (\w+) \((.+)\)", output, re.MULTILINE):
        reason = re.search(r"FAILED (\w+) \(\d+ checks?\)|(AddressSanitizer: [\w-]+)|runtime error: (.{1,40})", output)
        return f"{match[1]}: {next(filter(None, reason.groups())) if reason else match[2].lower()}"
    if match := re.search(r"line \d+ in (test_\w+)", output):  # faulthandler output of a crashed interpreter
        return f"{match[1]}: the interpreter crashed"
    lines = output.strip().splitlines()
    return lines[-1] if lines else "no output"


class SandboxedCopy:
    """A copy of the repository with its builds, isolated from the original; it contains one bug at a time."""

    def __init__(self, folder: Path, files: Sequence[str]) -> None:
        """Copy the repository to a subfolder of `folder`. files: paths in the repository."""
        self.folder = folder
        self.copy = folder / "copy"
        paths = (folder / "site", self.copy / "host", self.copy / "protocol", self.copy / "tools")
        # No .pyc file is written for a bug: prepare() compiles the copy without a bug.
        python_environment = {"PYTHONPATH": os.pathsep.join(map(str, paths)), "PYTHONDONTWRITEBYTECODE": "1"}
        # A TAXEL_ variable could point to a library of the original.
        inherited_environment = {name: value for name, value in os.environ.items() if not name.startswith("TAXEL_")}
        self._environment = inherited_environment | python_environment
        self._process: subprocess.Popen[bytes] | None = None
        self._synchronise(files)
        (folder / "site").mkdir(exist_ok=True)
        (folder / "site" / "sitecustomize.py").write_text(WITHOUT_EDITABLE)

    def _synchronise(self, files: Sequence[str]) -> None:
        """Make the copy equal to the repository.

        Unchanged files keep their time stamps, so the next build is incremental.
        """
        sources = {self.copy / name: ROOT / name for name in files}
        for path in self.copy.rglob("*"):
            if path.is_file() and path not in sources:
                path.unlink()
        for path, source in sources.items():
            if not path.exists() or path.read_bytes() != source.read_bytes():
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(source.read_bytes())
                path.chmod(source.stat().st_mode)

    def prepare(self) -> None:
        """Configure and build the copy without a bug.

        Raises PlantError on failure, or if Python would import files from outside the copy.
        """
        ninja = [] if _find_tool("ninja") == "ninja" else [f"-DCMAKE_MAKE_PROGRAM={_find_tool('ninja')}"]
        configure = [_find_tool("cmake"), "-G", "Ninja", *ninja]
        tests = ["-DTAXEL_BUILD_TESTS=ON", "-DTAXEL_SANITIZE=ON", "-DCMAKE_BUILD_TYPE=RelWithDebInfo"]
        package = ["-DTAXEL_INSTALL_PYTHON=ON", f"-DCMAKE_INSTALL_PREFIX={self.copy / 'host'}"]
        self._run_checked([*configure, "-S", str(self.copy / "firmware"), "-B", str(self.folder / "tests"), *tests])
        self._run_checked([*configure, "-S", str(self.copy), "-B", str(self.folder / "package"), *package])
        for build_name in ("tests", "package"):
            self.build(build_name)
        # Two bugs of a file may share its size and time of change, so byte code is matched to the source by a hash.
        compile_copy = ["-m", "compileall", "-q", "--invalidation-mode", "checked-hash", str(self.copy)]
        self._run_checked([sys.executable, *compile_copy])
        code, output = self._run([sys.executable, "-c", PROBE])
        for line in output.splitlines():
            if code or not (Path(line).exists() and Path(line).is_relative_to(self.copy)):
                raise PlantError(f"the suite would not test the copy: expected a path in {self.copy}, found {line}")

    def build(self, build_name: str, *programs: str) -> None:
        """Update a build of the copy.

        build_name: "tests" (C tests) or "package"; the libraries of the package are installed where the copy's Python
        package expects them. programs: targets; default: all. Raises PlantError.
        """
        targets = ["--target", *programs] if programs else []
        self._run_checked([_find_tool("cmake"), "--build", str(self.folder / build_name), "-j", "1", *targets])
        if build_name == "package":
            self._run_checked([_find_tool("cmake"), "--install", str(self.folder / build_name)])

    def _build_c_tests(self, stage: Stage) -> list[str]:
        """Build the C tests of a stage and return the command that runs them."""
        folder = self.folder / "tests"
        ctest = [_find_tool("ctest"), "--test-dir", str(folder), "-R", stage.pattern, "--no-tests=error"]
        code, output = self._run([*ctest, "--show-only=json-v1"])
        if code:
            raise PlantError(f"{stage.name}: {find_first_failure(output)}")
        programs = [Path(test["command"][0]) for test in json.loads(output[output.index("{") :])["tests"]]
        self.build("tests", *(str(program.relative_to(folder)) for program in programs))
        return [*ctest, "--output-on-failure", "--stop-on-failure"]

    def find_first_failing_test(self, stage: Stage, file: str = "") -> str | None:
        """Run a stage and return its first failing test, or None if all tests pass.

        file: file with the bug; the tests of its package run first. Raises PlantError if the C sources do not compile.
        """
        if stage.tests:
            self.build("package")
            command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "--tb=short"]
            own_first = sorted(stage.tests, key=lambda tests: Path(tests).stem not in file)
            command += ["-m", "not slow or listed", *own_first]
        else:
            command = self._build_c_tests(stage)
        code, output = self._run(command)
        (self.folder / f"{stage.name}.log").write_text(output)
        if code is None:
            return f"no result within {STAGE_TIMEOUT_S} s"
        return find_first_failure(output) if code else None

    def try_bug(self, bug: Bug) -> Outcome:
        """Plant a bug in the copy, run the stages until one fails, and remove the bug. Returns the outcome."""
        path = self.copy / bug.file
        text = path.read_text()
        begin = time.monotonic()
        found_by, test = None, ""
        path.write_text(bug.plant_in(text))
        try:
            for stage in select_stages(bug):
                if failure := self.find_first_failing_test(stage, bug.file):
                    found_by, test = stage.name, failure
                    break
        except PlantError as error:
            test = f"cannot be tested: {error}"
        finally:
            path.write_text(text)
        return Outcome(bug.name, bug.file, bug.what, found_by, test, round(time.monotonic() - begin, 1))

    def _run_checked(self, command: list[str]) -> None:
        """Run a build command in the copy. Raises `PlantError` with the first error message if the command fails."""
        code, output = self._run(command)
        if code:
            errors = [line for line in output.splitlines() if re.search(r"\b[Ee]rror\b[: ]", line)]
            raise PlantError(f"{Path(command[0]).name} failed: {(errors or [output.strip()[-200:]])[0]}")

    def _run(self, command: list[str]) -> tuple[int | None, str]:
        """Run a command in the copy, in its own process group, all of which is ended afterwards.

        Returns the exit status and the output; the status is None if the time limit was exceeded.
        """
        with tempfile.TemporaryFile() as output:
            self._process = subprocess.Popen(
                command, cwd=self.copy, env=self._environment, stdout=output, stderr=subprocess.STDOUT,
                start_new_session=True,
            )  # fmt: skip
            code: int | None = None
            with contextlib.suppress(subprocess.TimeoutExpired):
                code = self._process.wait(STAGE_TIMEOUT_S)
            self.kill_process()
            output.seek(0)
            return code, output.read().decode(errors="replace")

    def kill_process(self) -> None:
        """Kill the running command, if any, with all its child processes."""
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()


class SandboxPool:
    """Sandboxed copies that run in parallel, each with a different bug or stage."""

    def __init__(self, folder: Path, jobs: int) -> None:
        """Create `jobs` copies of the repository in a folder, each with its own builds, to test bugs in parallel."""
        listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        listed = subprocess.run(listing, cwd=ROOT, capture_output=True, check=True).stdout.decode()
        files = [name for name in listed.split("\0") if name and (ROOT / name).is_file()]
        self._free: queue.Queue[SandboxedCopy] = queue.Queue()
        self._pool = ThreadPoolExecutor(jobs)
        self._sandboxes = [SandboxedCopy(folder / f"copy{number}", files) for number in range(jobs)]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Stop all tests that still run."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        for sandbox in self._sandboxes:
            sandbox.kill_process()
        self._pool.shutdown()

    def prepare(self) -> None:
        """Build every copy of the repository. Raises PlantError."""
        list(self._pool.map(SandboxedCopy.prepare, self._sandboxes))
        for sandbox in self._sandboxes:
            self._free.put(sandbox)

    def check_without_bugs(self, stages: Sequence[Stage]) -> None:
        """Run the stages on copies without a bug and print the results. Raises PlantError if one fails."""
        for stage, failure in zip(stages, self._pool.map(self._find_failure, stages), strict=True):
            print(f"without a bug: {stage.name}: {failure or 'pass'}", flush=True)
            if failure:
                raise PlantError(f"{stage.name} fail without any bug ({failure}); fix this failure first")

    def _find_failure(self, stage: Stage) -> str | None:
        """Run a stage in a free copy without a bug. Returns the first failing test, or None."""
        sandbox = self._free.get()
        try:
            return sandbox.find_first_failing_test(stage)
        finally:
            self._free.put(sandbox)

    def try_all(self, bugs: Sequence[Bug]) -> list[Outcome]:
        """Plant every bug and run the tests, several bugs in parallel.

        Returns the outcomes in the order of the bugs.
        """
        width = max(len(bug.name) for bug in bugs)
        return list(self._pool.map(lambda bug: self._try(bug, width), bugs))

    def _try(self, bug: Bug, width: int) -> Outcome:
        """Plant a bug in a free copy and run the tests until one fails. Prints and returns the outcome.

        width: width of the column for the bug's name.
        """
        sandbox = self._free.get()
        try:
            outcome = sandbox.try_bug(bug)
        finally:
            self._free.put(sandbox)
        result = outcome.found_by or "SURVIVED"
        print(f"{bug.name:{width}s} {result:14s} {outcome.seconds:6.1f} s  {outcome.test}", flush=True)
        return outcome
