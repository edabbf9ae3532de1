"""Which skin the tests run on."""

from collections.abc import Iterator

import pytest

import taxel


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--url", default="emulator:?speed=max", help="the skin under test (default: the emulated one)")
    parser.addoption("--hand", default="allegro", help="its hand description")


@pytest.fixture
def skin(request: pytest.FixtureRequest) -> Iterator[taxel.Skin]:
    """An open, streaming skin."""
    with taxel.open(request.config.getoption("--url"), request.config.getoption("--hand")) as opened:
        yield opened
