"""Fixtures: the modules of tools/cortex, and the installed oracles."""

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "tools" / "cortex"
NAMES = ("bare_cpu", "unicorn_oracle", "cases", "deviations", "differential", "images")


@pytest.fixture(scope="session")
def cortex():
    sys.path.insert(0, str(FOLDER))
    yield SimpleNamespace(**{name: importlib.import_module(name) for name in NAMES})
    while str(FOLDER) in sys.path:
        sys.path.remove(str(FOLDER))


@pytest.fixture(scope="session")
def image_of(cortex) -> Callable:
    """Compile a program, or skip the test and name the missing tool."""

    def build(name: str):
        try:
            return cortex.images.build_image(name)
        except cortex.images.ToolMissingError as missing:
            pytest.skip(str(missing))

    return build


@pytest.fixture(scope="session")
def in_qemu(cortex) -> Callable:
    def run(image, **options):
        try:
            return cortex.images.run_qemu(image, **options)
        except cortex.images.ToolMissingError as missing:
            pytest.skip(str(missing))

    return run


@pytest.fixture(scope="session")
def in_unicorn(cortex) -> Callable:
    def run(image):
        try:
            return cortex.images.run_unicorn(image)
        except cortex.unicorn_oracle.UnicornMissingError as missing:
            pytest.skip(str(missing))

    return run


@pytest.fixture
def oracle(cortex):
    try:
        opened = cortex.unicorn_oracle.UnicornOracle()
    except cortex.unicorn_oracle.UnicornMissingError as missing:
        pytest.skip(str(missing))
    with opened:
        yield opened
