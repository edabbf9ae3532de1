"""The code blocks of every page run in order in a temporary folder, or are checked without being run.

`make docs-test` (TAXEL_DOCS=all) also runs the long blocks: each line in a shell, with shortened campaigns.
"""

import ast
import importlib
import os
import re
import shlex
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest
import typer

from host.tests.command_line import run_taxel
from host.tests.docs.page_blocks import (
    COMMAND,
    REASONS_NOT_TO_RUN,
    ROOT,
    Block,
    is_run_elsewhere,
    list_pages,
    read_blocks,
)
from taxel.cli.main import build_app

RUNS_ALL = os.environ.get("TAXEL_DOCS") == "all"
EXIT_STATUS = re.compile(r"# exit status (\d)")
SHORTENED_COMMANDS = ((re.compile(r"(taxel grasp (?!.*--grasps)[^&#]*)"), r"\1 --grasps 12 "),)
"""Substitutions of `make docs-test`: campaigns of 12 grasps, which take seconds instead of minutes."""

PAGES = [page for page in list_pages() if any(block.language for block in read_blocks(page))]
RUN_HERE = [
    page
    for page in PAGES
    if any(b.language in ("sh", "python") for b in read_blocks(page)) and not is_run_elsewhere(page)
]


def relative_name(page: Path) -> str:
    """Return the path of a page relative to the repository, as an id of a test."""
    return str(page.relative_to(ROOT))


def read_commands(text: str) -> list[str]:
    """Return the commands of a shell block; a line that ends with a backslash is joined with the next line."""
    return [line for line in text.replace("\\\n", " ").splitlines() if line.strip() and not line.startswith("#")]


def check_command(arguments: list[str]) -> None:
    """Raise an error for an unknown command, option, make target or script, without running the command."""
    program, *rest = arguments
    if program == "taxel":
        command = typer.main.get_command(build_app(loads_all=True))
        while rest and rest[0] in getattr(command, "commands", {}):
            command = command.commands[rest.pop(0)]
        if not {"--help", "-h"} & set(rest):
            command.make_context("taxel", list(rest), resilient_parsing=False)
    elif program == "make":
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert {word for word in rest if "=" not in word} <= set(targets), arguments
    elif program.endswith("python") and rest and rest[0].startswith(("tools/", "hil_tests/")):
        assert (ROOT / rest[0]).is_file(), arguments


def check_block(block: Block) -> None:
    """Raise an error for invalid TOML, Python syntax, imports of `taxel` or commands of a block, without running it."""
    if block.language == "toml":
        tomllib.loads(block.text)
    if block.language == "python":
        tree = ast.parse(block.text)
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in ("taxel", "taxel_tools"):
                module = importlib.import_module(node.module or "")
                assert all(hasattr(module, name.name) or find_spec(f"{node.module}.{name.name}") for name in node.names)
    if block.language == "sh":
        for line in read_commands(block.text):
            for part in re.split(r"\s&&\s|\s\|\s", line):
                check_command(shlex.split(part, comments=True))


def run_line(line: str, folder: Path, environment: dict[str, str]) -> None:
    """Run a command of a shell block, and assert that it ends with the exit status that its comment states (default 0).

    Commands of `taxel` run in this process, which is faster than a shell, except in `make docs-test`.
    """
    match = EXIT_STATUS.search(line)
    expected_status = int(match[1]) if match else 0
    arguments = shlex.split(line, comments=True)
    if arguments[0] == "." and arguments[1:] == [".venv/bin/activate"]:
        return  # the tests already run in this environment
    if not RUNS_ALL and arguments[0] == "taxel" and "--help" not in arguments and folder != ROOT:
        assert run_taxel(*arguments[1:]) == expected_status, line
        return
    for pattern, shortened in SHORTENED_COMMANDS:
        line = pattern.sub(shortened, line)
    line = line.replace("python tools/", f"python {ROOT}/tools/")
    result = subprocess.run(
        ["bash", "-c", line], cwd=folder, env=environment, capture_output=True, text=True, timeout=1800
    )
    assert result.returncode == expected_status, f"{line}\n{result.stdout[-2000:]}\n{result.stderr[-2000:]}"


@pytest.mark.parametrize("page", RUN_HERE, ids=relative_name)
def test_the_blocks_of_a_page_run_in_their_order(page, tmp_path, monkeypatch):
    """A block with a file name is written to the temporary folder, and Python blocks share one namespace.

    Blocks of the mode "root" run in the repository, and "root" and "long" blocks run only in `make docs-test`.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "COLUMNS": "120"}
    namespace: dict[str, object] = {"__name__": "__main__"}
    for block in read_blocks(page):
        check_block(block)
        if block.file:
            (tmp_path / block.file).write_text(block.text)
        elif block.is_only_checked or (block.mode == "long" and not RUNS_ALL):
            continue
        elif block.language == "python":
            code = compile("\n" * block.line + block.text, str(page), "exec")
            exec(code, namespace)
        elif block.language == "sh" and (RUNS_ALL or block.mode != "root"):
            for line in read_commands(block.text):
                run_line(line, ROOT if block.mode == "root" else tmp_path, environment)
    for name, module in [*sys.modules.items()]:  # remove modules imported from the temporary folder
        if str(getattr(module, "__file__", None)).startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.mark.parametrize("page", list_pages(), ids=relative_name)
def test_every_block_has_a_valid_mode_and_passes_the_static_checks(page):
    """The mode states how a block runs or why it does not. The text above a block for hardware states the need."""
    text = page.read_text().splitlines()
    for block in read_blocks(page):
        assert not block.mode or block.mode in ("long", "root", *REASONS_NOT_TO_RUN), block
        if block.mode == "hardware":
            preceding_lines = " ".join(text[max(block.line - 8, 0) : block.line]).lower()
            assert "need hardware" in preceding_lines or "needs hardware" in preceding_lines, (
                f"{block}: the text above the block must contain 'needs hardware'"
            )
        if block.language in ("", "text"):
            assert not COMMAND.search(block.text), f"{block}: a command must be in a block marked sh"
        if block.language in ("toml", "python", "sh") and page not in RUN_HERE:
            check_block(block)
