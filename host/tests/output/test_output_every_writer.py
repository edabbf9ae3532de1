"""Every call that writes a file goes through taxel.output, except the calls of a list with reasons."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
FOLDERS = ("host/taxel", "tools", "hil_tests", "examples")

TEMPORARY = "file of a temporary folder that the program itself removes"
GENERATED = "product of a build or of code generation; the same command writes it again from tracked files"
DEVELOPMENT = "scratch file of a program for developers, which reads it in the same run"

ALLOWED = {
    "host/taxel/output/": "the module itself",
    "host/taxel/blind/diagnosis_process.py": "report in the sandbox, copied by the parent process",
    "host/taxel/blind/benchmark/worlds.py": TEMPORARY,
    "host/taxel/blind/injection/inject.py": TEMPORARY,
    "host/taxel/blind/shuffling.py": "dataset of a world, which is made again unless the world has its mark `done`",
    "host/taxel/blind/sandboxed_run.py": TEMPORARY,
    "host/taxel/cli/emulate.py": TEMPORARY,
    "host/taxel/emulated/contact.py": TEMPORARY,
    "host/taxel/gap/apply/user_simulator.py": "file in the temporary folder of `open_temporary_output`",
    "host/taxel/gap/apply/rewriting.py": "copy in the temporary folder of `open_temporary_output`",
    "host/taxel/gap/fitting/forked_workers.py": "pipe to a process",
    "host/taxel/link/emulator.py": TEMPORARY,
    "host/taxel/link/virtual/world.py": TEMPORARY,
    "host/taxel/recording/importers/source_ros.py": "SQLite database, opened for reading only",
    "host/taxel/recording/formats/csv_format.py": "files in the temporary folder of a `PendingOutput`",
    "host/taxel/skin/mcap_skin.py": "a method of `McapFile` with the same name",
    "host/taxel/recording/formats/parquet_format.py": "temporary file of a `PendingOutput`",
    "tools/taxel_tools/bench/pictures.py": "picture in memory",
    "tools/taxel_tools/testing/history.py": "SQLite writes its own journal and locks its file",
    "hil_tests/harness/virtual/images.py": "lock file of a build",
    "tools/bench/": DEVELOPMENT,
    "tools/clients/": DEVELOPMENT,
    "tools/cloud/": DEVELOPMENT,
    "tools/codegen/": GENERATED,
    "tools/crash/": DEVELOPMENT,
    "tools/docs/": GENERATED,
    "tools/firmware/": GENERATED,
    "tools/fuzz": DEVELOPMENT,
    "tools/hand/": GENERATED,
    "tools/mutants/": DEVELOPMENT,
    "tools/release/": GENERATED,
}
"""Start of a path -> reason why a direct write is permitted."""

METHODS = {"write_text", "write_bytes", "savefig", "touch"}
SHUTIL_FUNCTIONS = {"copyfile", "copy", "copy2", "move", "copytree"}
NUMPY_FUNCTIONS = {"save", "savez", "savez_compressed", "savetxt"}


def find_direct_writes(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield (line number, name of the function) of each call in a module that writes a file by its path."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        owner = node.func.value if isinstance(node.func, ast.Attribute) else None
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        owner_name = owner.id if isinstance(owner, ast.Name) else ""
        candidates = (*node.args[:2], *(word.value for word in node.keywords if word.arg == "mode"))
        modes = [item.value for item in candidates if isinstance(item, ast.Constant) and isinstance(item.value, str)]
        is_writing = any(set(mode) <= set("rwxab+t") and set(mode) & set("wxa+") for mode in modes)
        goes_to_open_file = bool(node.args) and getattr(node.args[0], "id", "") == "file"
        if (
            name in METHODS
            or (owner_name == "shutil" and name in SHUTIL_FUNCTIONS)
            or (owner_name == "np" and name in NUMPY_FUNCTIONS and not goes_to_open_file)
            or (name in ("open", "fdopen", "File") and is_writing)
            or (owner_name, name) == ("sqlite3", "connect")
            or name == "ParquetWriter"
        ):
            yield node.lineno, name


def list_sources() -> list[Path]:
    """List the Python files of the project, except tests."""
    return [
        path
        for folder in FOLDERS
        for path in sorted((ROOT / folder).rglob("*.py"))
        if "tests" not in path.parts and not path.name.startswith("test_")
    ]


def test_every_direct_write_has_a_reason():
    """Files are written by `taxel.output`; `ALLOWED` contains the exceptions with their reasons."""
    unexplained = [
        f"{path.relative_to(ROOT)}:{line}: {call}: use taxel.output"
        for path in list_sources()
        for line, call in find_direct_writes(ast.parse(path.read_text()))
        if not str(path.relative_to(ROOT)).startswith(tuple(ALLOWED))
    ]
    assert not unexplained, "\n".join(unexplained)


@pytest.mark.parametrize("start", ALLOWED)
def test_every_entry_of_the_permitted_writers_is_needed(start):
    if start == "host/taxel/output/":
        return  # the module that writes all files needs no other reason
    paths = [path for path in list_sources() if str(path.relative_to(ROOT)).startswith(start)]
    assert any(list(find_direct_writes(ast.parse(path.read_text()))) for path in paths), f"remove {start}"


@pytest.mark.parametrize(
    "text",
    ["p.write_text('x')", "open(p, 'w')", "p.open('ab')", "h5py.File(p, 'r+')", "figure.savefig(p)", "np.savez(p)"],
)
def test_direct_writes_are_found(text):
    assert list(find_direct_writes(ast.parse(text)))


@pytest.mark.parametrize("text", ["open(p)", "p.open('rb')", "h5py.File(p, 'r')", "write_whole(p, 'x')"])
def test_other_calls_are_not_direct_writes(text):
    assert not list(find_direct_writes(ast.parse(text)))
