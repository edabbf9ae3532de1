"""Fixtures: the modules of tools/cortex, and the installed oracles."""

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "tools" / "cortex"
MODULES = ("bare_cpu", "unicorn_oracle", "cases", "deviations", "differential", "images")


@pytest.fixture(scope="session")
def cortex():
    """The modules of tools/cortex."""
    sys.path.insert(0, str(FOLDER))
    yield SimpleNamespace(**{name: importlib.import_module(name) for name in MODULES})
    while str(FOLDER) in sys.path:
        sys.path.remove(str(FOLDER))


@pytest.fixture(scope="session")
def build_image(cortex) -> Callable:
    """Builds a program by name; skips the test if a tool is missing."""

    def build(name: str):
        try:
            return cortex.images.build_image(name)
        except cortex.images.ToolMissingError as missing:
            pytest.skip(str(missing))

    return build


@pytest.fixture(scope="session")
def run_in_qemu(cortex) -> Callable:
    """Runs an image in QEMU; skips the test if QEMU is missing."""

    def run(image, **options):
        try:
            return cortex.images.run_qemu(image, **options)
        except cortex.images.ToolMissingError as missing:
            pytest.skip(str(missing))

    return run


@pytest.fixture(scope="session")
def run_in_unicorn(cortex) -> Callable:
    """Runs an image in Unicorn; skips the test if Unicorn is missing."""

    def run(image):
        try:
            return cortex.images.run_unicorn(image)
        except cortex.unicorn_oracle.UnicornMissingError as missing:
            pytest.skip(str(missing))

    return run


@pytest.fixture
def oracle(cortex):
    """Unicorn as the reference for single instructions."""
    try:
        unicorn_oracle = cortex.unicorn_oracle.UnicornOracle()
    except cortex.unicorn_oracle.UnicornMissingError as missing:
        pytest.skip(str(missing))
    with unicorn_oracle:
        yield unicorn_oracle
