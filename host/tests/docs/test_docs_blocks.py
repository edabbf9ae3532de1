"""Every block of code of every page: run in its order in a temporary folder, or checked as far as that goes.

`make docs-test` (TAXEL_DOCS=all) runs the long ones too, each line in a shell, campaigns shortened.
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

from host.tests.command_line import exit_status
from host.tests.docs.page_blocks import COMMAND, REASONS, ROOT, Block, blocks_of, pages, runs_elsewhere
from taxel.cli.main import build_app

ALL = os.environ.get("TAXEL_DOCS") == "all"
STATUS = re.compile(r"# exit status (\d)")
SHORTER = ((re.compile(r"(taxel grasp (?!.*--grasps)[^&#]*)"), r"\1 --grasps 12 "),)
"""What `make docs-test` changes of a command, so that it takes seconds instead of minutes: campaigns of 12 grasps."""

PAGES = [page for page in pages() if any(block.language for block in blocks_of(page))]
RUN_HERE = [
    page for page in PAGES if any(b.language in ("sh", "python") for b in blocks_of(page)) and not runs_elsewhere(page)
]


def named(page: Path) -> str:
    return str(page.relative_to(ROOT))


def lines_of(text: str) -> list[str]:
    """Commands, continued lines joined."""
    return [line for line in text.replace("\\\n", " ").splitlines() if line.strip() and not line.startswith("#")]


def check_words(words: list[str]) -> None:
    """Raises for a command, an option, a target or a script that there is not; nothing is run."""
    program, *rest = words
    if program == "taxel":
        command = typer.main.get_command(build_app(loads_all=True))
        while rest and rest[0] in getattr(command, "commands", {}):
            command = command.commands[rest.pop(0)]
        if not {"--help", "-h"} & set(rest):
            command.make_context("taxel", list(rest), resilient_parsing=False)
    elif program == "make":
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert {word for word in rest if "=" not in word} <= set(targets), words
    elif program.endswith("python") and rest and rest[0].startswith(("tools/", "hil_tests/")):
        assert (ROOT / rest[0]).is_file(), words


def check(block: Block) -> None:
    """What can be said of a block without running it."""
    if block.language == "toml":
        tomllib.loads(block.text)
    if block.language == "python":
        tree = ast.parse(block.text)
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in ("taxel", "taxel_tools"):
                module = importlib.import_module(node.module or "")
                assert all(hasattr(module, name.name) or find_spec(f"{node.module}.{name.name}") for name in node.names)
    if block.language == "sh":
        for line in lines_of(block.text):
            for part in re.split(r"\s&&\s|\s\|\s", line):
                check_words(shlex.split(part, comments=True))


def run_line(line: str, folder: Path, environment: dict[str, str]) -> None:
    """One command as a reader gives it; in one process where that is quick."""
    expected = STATUS.search(line)
    wanted = int(expected[1]) if expected else 0
    words = shlex.split(line, comments=True)
    if words[0] == "." and words[1:] == [".venv/bin/activate"]:
        return  # the tests' environment is that one
    if not ALL and words[0] == "taxel" and "--help" not in words and folder != ROOT:
        assert exit_status(*words[1:]) == wanted, line
        return
    for pattern, shorter in SHORTER:
        line = pattern.sub(shorter, line)
    line = line.replace("python tools/", f"python {ROOT}/tools/")
    done = subprocess.run(
        ["bash", "-c", line], cwd=folder, env=environment, capture_output=True, text=True, timeout=1800
    )
    assert done.returncode == wanted, f"{line}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"


@pytest.mark.parametrize("page", RUN_HERE, ids=named)
def test_a_pages_blocks_run_in_their_order(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "COLUMNS": "120"}
    namespace: dict[str, object] = {"__name__": "__main__"}
    for block in blocks_of(page):
        check(block)
        if block.file:
            (tmp_path / block.file).write_text(block.text)
        elif block.never or (block.how == "long" and not ALL):
            continue
        elif block.language == "python":
            code = compile("\n" * block.line + block.text, str(page), "exec")
            exec(code, namespace)
        elif block.language == "sh" and (ALL or block.how != "root"):
            for line in lines_of(block.text):
                run_line(line, ROOT if block.how == "root" else tmp_path, environment)
    for name, module in [*sys.modules.items()]:  # nor are its files
        if str(getattr(module, "__file__", None)).startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.mark.parametrize("page", pages(), ids=named)
def test_blocks_say_what_they_are(page):
    text = page.read_text().splitlines()
    for block in blocks_of(page):
        assert not block.how or block.how in ("long", "root", *REASONS), block
        if block.how == "hardware":
            before = " ".join(text[max(block.line - 8, 0) : block.line]).lower()
            assert "need hardware" in before or "needs hardware" in before, f"{block}: the page must say so just before"
        if block.language in ("", "text"):
            assert not COMMAND.search(block.text), f"{block}: commands stand in a block of their own, marked sh"
        if block.language in ("toml", "python", "sh") and page not in RUN_HERE:
            check(block)
