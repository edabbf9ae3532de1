"""The folder of tools/clients on the import path, and the built programs of the clients."""

import importlib
import sys
from pathlib import Path

import pytest

FOLDER = str(Path(__file__).resolve().parents[3] / "tools" / "clients")
sys.path.insert(0, FOLDER)
try:
    programs = importlib.import_module("programs")
    captures = importlib.import_module("captures")
    reference = importlib.import_module("reference")
    fuzzed_streams = importlib.import_module("fuzzed_streams")
    kaitai_frames = importlib.import_module("kaitai_frames")
finally:
    sys.path.remove(FOLDER)


@pytest.fixture(scope="session", params=programs.LANGUAGES)
def command(request):
    """The command of a client's program that prints decoded frames."""
    try:
        return programs.build_program(request.param)
    except programs.ProgramMissingError as error:
        pytest.skip(str(error))
