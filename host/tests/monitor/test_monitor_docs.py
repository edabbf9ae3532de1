"""docs/how-to-monitor.md: all code blocks run."""

import re
import shlex
from pathlib import Path

import pytest

from host.tests.command_line import run_taxel

ROOT = Path(__file__).resolve().parents[3]
GUIDE = ROOT / "docs" / "how-to-monitor.md"
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)
SECONDS_OPTION = re.compile(r"(--seconds) \d+")


def read_blocks(language):
    """The code blocks of the guide in a language, in order."""
    return [text for block_language, text in BLOCK.findall(GUIDE.read_text()) if block_language == language]


def test_commands_of_the_guide_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for line in "".join(read_blocks("sh")).splitlines():
        if "--web" in line:
            pytest.importorskip("viser", reason="no viser: pip install 'taxel[web]'")
        arguments = shlex.split(SECONDS_OPTION.sub(r"\1 0.4", line), comments=True)  # shorter than for a user
        assert arguments[0] == "taxel"
        status = run_taxel(*arguments[1:])
        output = capsys.readouterr()
        assert status == 0, f"{line}: {output.err}"
        assert "boards" in output.out or arguments[1] == "record"


def test_python_example_of_the_guide_runs(capsys):
    (text,) = read_blocks("python")
    exec(compile(text, str(GUIDE), "exec"), {})
    assert "0 active;" in capsys.readouterr().out


def test_pictures_of_the_guide_exist():
    for name in re.findall(r"\]\((images/[\w.-]+)\)", GUIDE.read_text()):
        assert (GUIDE.parent / name).stat().st_size > 10_000
