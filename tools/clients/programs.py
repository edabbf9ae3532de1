"""Build and run the programs of the clients in other languages, which print decoded frames as text lines."""

import fcntl
import hashlib
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CLIENTS = ROOT / "protocol" / "clients"
BUILD = ROOT / "build" / "clients"
DISSECTOR = CLIENTS / "lua" / "taxel_wireshark.lua"
LANGUAGES = ("cpp", "rust", "lua")
_TIMEOUT_S = 600


class ProgramMissingError(Exception):
    """Error: a compiler or interpreter is not installed; the message names it and its Debian package."""


def find_program(names: Sequence[str], package: str) -> str:
    """Return the path of the first program of `names` that is installed.

    Raises ProgramMissingError if none is installed; its message states the Debian package `package`.
    """
    for name in names:
        path = shutil.which(name)
        if path:
            return path
    raise ProgramMissingError(f"{names[0]} is missing: apt-get install {package}")


def build_program(language: str, name: str = "dump", is_optimised: bool = False) -> list[str]:
    """Build the program of a client, unless it is up to date; return the command that starts it.

    name: file in the client's folder `tests` or `examples` without suffix. is_optimised: for long captures; otherwise
    the build takes half the time, and the Rust client detects overflows. Raises ProgramMissingError if the compiler is
    missing, and CalledProcessError with its output if it reports an error or a warning.
    """
    return {"cpp": _build_cpp, "rust": _build_rust, "lua": _build_lua}[language](name, is_optimised)


def _compile(command: Sequence[str], language: str, name: str) -> Path:
    """Compile to a file whose name contains a digest of command and sources, and return this file.

    language: folder of the client, whose files are the sources. name: start of the file name. A file that exists
    already is up to date and is not compiled again. Raises CalledProcessError with the output of the compiler if it
    fails.
    """
    digest = hashlib.sha256("\0".join(command).encode())
    for path in sorted(CLIENTS.joinpath(language).rglob("*.*")):
        digest.update(path.read_bytes())
    target = BUILD / f"{name}-{digest.hexdigest()[:16]}{'.rlib' if name.startswith('lib') else ''}"
    if target.exists():
        return target
    BUILD.mkdir(parents=True, exist_ok=True)
    with (BUILD / f".{target.name}.lock").open("w") as lock, tempfile.TemporaryDirectory(dir=BUILD) as folder:
        fcntl.flock(lock, fcntl.LOCK_EX)  # other processes of a test run need the same file
        if target.exists():
            return target
        output = Path(folder) / target.name
        result = subprocess.run([*command, "-o", str(output)], capture_output=True, text=True, timeout=_TIMEOUT_S)
        if result.returncode:
            raise subprocess.CalledProcessError(result.returncode, list(command), result.stdout, result.stderr)
        output.replace(target)
    return target


def _find_source(language: str, name: str, suffix: str) -> Path:
    """Return the path of a client's source file in its folder `tests` or `examples`. name: file name without suffix."""
    folders = (CLIENTS / language / part for part in ("tests", "examples"))
    return next(path for folder in folders if (path := folder / f"{name}{suffix}").exists())


def compile_cpp(source: Path, name: str, options: Sequence[str]) -> Path:
    """Compile a C++ source that uses the client, with warnings as errors; return the output file.

    name: start of the name of the output file. options: further options of the compiler. Raises ProgramMissingError
    without a compiler, and CalledProcessError after an error or a warning.
    """
    compiler = find_program(("g++", "clang++"), "g++")
    warnings = ("-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror")
    include = str(CLIENTS / "cpp/include")
    return _compile([compiler, "-std=c++17", *warnings, *options, "-I", include, str(source)], "cpp", name)


def _build_cpp(name: str, is_optimised: bool) -> list[str]:
    """Compile a program of the C++ client; return the command that starts it."""
    options = ["-O2" if is_optimised else "-O0"]
    return [str(compile_cpp(_find_source("cpp", name, ".cpp"), f"cpp-{name}", options))]


def _build_rust(name: str, is_optimised: bool) -> list[str]:
    """Compile the crate and a program that uses it; return the command that starts the program."""
    compiler = find_program(("rustc",), "rustc")
    command = [compiler, "--edition", "2021", "-D", "warnings", *(["-O"] if is_optimised else [])]
    source = str(CLIENTS / "rust/src/lib.rs")
    crate = [*command, "--crate-type=rlib", "--crate-name=taxel_client", source]
    library = _compile(crate, "rust", "libtaxel_client")
    example = str(_find_source("rust", name, ".rs"))
    return [str(_compile([*command, "--extern", f"taxel_client={library}", example], "rust", f"rust-{name}"))]


def _build_lua(name: str, is_optimised: bool) -> list[str]:
    """Return the command of a program of the Lua client, which needs no build."""
    interpreter = find_program(("lua5.4", "lua5.3", "lua"), "lua5.4")
    return [interpreter, str(_find_source("lua", name, ".lua"))]


def run_program(command: Sequence[str], text: str = "") -> list[str]:
    """Run a program with `text` as its standard input; return the lines of its output. Raises CalledProcessError."""
    result = subprocess.run(command, input=text, capture_output=True, text=True, timeout=_TIMEOUT_S)
    if result.returncode:
        raise subprocess.CalledProcessError(result.returncode, list(command), result.stdout, result.stderr)
    return result.stdout.splitlines()


def run_dissector(path: Path, fields: Sequence[str]) -> list[list[str]]:
    """Dissect a PCAPNG file with tshark, and return the values of `fields` in each packet.

    The values of a field that occurs several times in a packet are one string, separated by ";". Raises
    ProgramMissingError.
    """
    tshark = find_program(("tshark",), "tshark")
    options = [part for name in fields for part in ("-e", name)]
    command = [tshark, "-X", f"lua_script:{DISSECTOR}", "-r", str(path), "-T", "fields", "-E", "aggregator=;", *options]
    return [line.split("\t") for line in run_program(command)]
