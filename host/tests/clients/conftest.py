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


def skip_if_missing(function, *arguments):
    """Return the result of a function, or skip the test if a compiler or an interpreter is missing.

    All tests are skipped with the same line.
    """
    try:
        return function(*arguments)
    except programs.ProgramMissingError as error:
        pytest.skip(str(error))


def run_client(language, *arguments, text="", name="dump"):
    """Run a program of the client in a language, and return the lines that it prints.

    arguments, text: arguments and standard input of the program. name: name of the program.
    """
    return programs.run_program([*skip_if_missing(programs.build_program, language, name), *arguments], text)
