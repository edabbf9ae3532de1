"""Pictures of README.md: only a demonstration that is right is shown."""

import runpy
from pathlib import Path

import pytest

TOOL = runpy.run_path(str(Path(__file__).resolve().parents[3] / "tools" / "docs" / "make_pictures.py"))


@pytest.fixture
def demonstrate(monkeypatch):
    """A function that replaces `taxel` by a program with these outputs, one for each demonstration."""

    def replace(*outputs):
        remaining = iter(outputs)

        def run(*arguments):
            folder = Path(arguments[-1])
            folder.mkdir()
            (folder / "hand.png").write_bytes(b"picture")
            return next(remaining, "WRONG: the diagnosis named unknown.")

        monkeypatch.setitem(TOOL["find_right_demonstration"].__globals__, "run_taxel", run)

    return replace


def test_the_first_right_demonstration_with_a_cause_is_shown(demonstrate, tmp_path):
    demonstrate(
        "hidden: noise\nWRONG: the diagnosis named unknown.\n",
        "hidden: nothing\nRIGHT: the diagnosis named no gap.\n",
        "hidden: drift\nRIGHT: the diagnosis named drift.\n",
    )
    assert TOOL["find_right_demonstration"](tmp_path) == tmp_path / "demo3" / "hand.png"


def test_without_a_right_demonstration_no_picture_is_made(demonstrate, tmp_path):
    demonstrate()
    with pytest.raises(TOOL["PictureError"], match="no demonstration with the seeds 1 to 8 is right"):
        TOOL["find_right_demonstration"](tmp_path)


def test_a_command_that_fails_is_named(monkeypatch):
    class Result:
        """Result of a program that has failed."""

        returncode, stdout, stderr = 2, "", "a warning\n--out: is no folder\n"

    monkeypatch.setattr(TOOL["subprocess"], "run", lambda *arguments, **options: Result)
    with pytest.raises(TOOL["PictureError"], match="taxel feel ended with status 2: --out: is no folder"):
        TOOL["run_taxel"]("feel")
