"""Functions that no command, example or guide reaches, from the coverage report of `make coverage`.

    python tools/coverage/unreached.py out/coverage/commands.json

A function is reached if at least one line of its body was executed. Each unreached function is listed by the places
that use its name:

- nothing: no tracked file uses the name
- tests: only tests use the name
- unreached code: only lines that were not executed use the name, such as a driver of hardware
- reached code: an executed statement uses the name, such as an error path, or another function has the same name

The first two groups are candidates for deletion.
"""

import argparse
import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

ROOT: Final = Path(__file__).resolve().parents[2]
NAME: Final = re.compile(r"[A-Za-z_]\w*")
GROUPS: Final = ("nothing", "tests", "unreached code", "reached code")
"""Users of an unreached function, in the order of the list."""

Report = dict[str, Any]
"""JSON report of coverage.py."""


class UnreachedFunction(NamedTuple):
    """A function of which no line was executed. used_by: member of `GROUPS`."""

    file: str
    line: int
    name: str
    used_by: str


class NameUse(NamedTuple):
    """Identifiers that occur in tests, in statements that were not executed, and in all other places."""

    tests: set[str]
    unreached: set[str]
    reached: set[str]


def main() -> int:
    """Print the functions of which no line was executed, in groups by the places that use their names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=Path, help="JSON report of coverage.py, version 7.6 or later")
    parser.add_argument("--used-by", choices=GROUPS, help="only this group")
    arguments = parser.parse_args()
    unreached = list(find_unreached(json.loads(arguments.report.read_text())))
    for group in GROUPS if arguments.used_by is None else (arguments.used_by,):
        members = [function for function in unreached if function.used_by == group]
        print(f"used by {group}: {len(members)}")
        for function in members:
            print(f"  {function.file}:{function.line}: {function.name}")
    return 0


def find_unreached(report: Report) -> Iterator[UnreachedFunction]:
    """Yield the functions of which no line was executed, except stubs of interfaces and special methods."""
    use = collect_names(report)
    for file, content in sorted(report["files"].items()):
        stub_lines = find_stub_lines(ROOT / file)
        for qualified_name, function in content["functions"].items():
            name = qualified_name.rpartition(".")[2]
            if not name or name.startswith("__") or function["executed_lines"] or not function["missing_lines"]:
                continue
            if function["start_line"] not in stub_lines:
                yield UnreachedFunction(file, function["start_line"], qualified_name, find_user(name, use))


def find_user(name: str, use: NameUse) -> str:
    """Return which places use an identifier; the first that applies of "reached code", "unreached code", "tests",
    "nothing".
    """
    if name in use.reached:
        return "reached code"
    if name in use.unreached:
        return "unreached code"
    return "tests" if name in use.tests else "nothing"


def collect_names(report: Report) -> NameUse:
    """Collect the identifiers that the tracked files use.

    The name in a definition and the names in imports are not uses.
    """
    use = NameUse(set(), set(), set())
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for file in listed.splitlines():
        if not file.endswith((".py", ".md", ".toml", ".html")):
            continue
        text = (ROOT / file).read_text(encoding="utf-8")
        if "/tests/" in file or "/test_" in file:
            use.tests.update(NAME.findall(text))
        elif file in report["files"]:
            executed = set(report["files"][file]["executed_lines"])
            for line, source in split_statements(text, is_interface=file.endswith("__init__.py")):
                (use.reached if line in executed else use.unreached).update(NAME.findall(source))
        else:
            use.reached.update(NAME.findall(text))
    return use


def split_statements(text: str, is_interface: bool) -> Iterator[tuple[int, str]]:
    """Yield the first line number and the source of each statement without its body, except docstrings.

    is_interface: also yields imports, whose names other packages use. A decorator is yielded separately.
    """
    lines = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        is_docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        is_import = isinstance(node, ast.Import | ast.ImportFrom)
        if not isinstance(node, ast.stmt) or is_docstring or (is_import and not is_interface):
            continue
        body = getattr(node, "body", None)
        end = body[0].lineno - 1 if body and body[0].lineno > node.lineno else node.end_lineno
        source = "\n".join(lines[node.lineno - 1 : end])
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            source = source.replace(node.name, "", 1)
            for decorator in node.decorator_list:
                yield decorator.lineno, ast.unparse(decorator)
        yield node.lineno, source


def find_stub_lines(path: Path) -> set[int]:
    """Return the first lines of functions whose body is a docstring, `...`, `pass` or `raise NotImplementedError`."""
    lines = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and all(map(is_empty_statement, node.body)):
            lines |= {node.lineno, *(decorator.lineno for decorator in node.decorator_list)}
    return lines


def is_empty_statement(statement: ast.stmt) -> bool:
    """Return whether a statement has no effect: a docstring, `...`, `pass` or `raise NotImplementedError`."""
    if isinstance(statement, ast.Raise):
        return "NotImplementedError" in ast.unparse(statement)
    is_constant = isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
    return is_constant or isinstance(statement, ast.Pass)


if __name__ == "__main__":
    sys.exit(main())
