"""URLs and adapters of a skin without a hub: every fault gives one line that names the adapter."""

import errno
import os
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import smbus2

from taxel.link import LinkError, PortMissingError, PortVanishedError, open_link
from taxel.link.linux_hub import LinuxHubLink, parse_i2c_url
from taxel.link.linux_hub import url as i2c_url
from taxel.link.linux_hub.adapter import check_board_answers, open_adapter, read_scl_hz
from taxel.optional import MissingPackageError

I2C_AND_SMBUS, SMBUS_ONLY = 0x0EFF0001, 0x0EFF0000


class FakeAdapter:
    """I2C adapter in place of smbus2: boards answer at the addresses `answers`, other transfers fail with `error`.

    funcs: functions that the adapter declares (I2C_FUNCS). addressed: addresses of all transfers so far.
    """

    def __init__(self, answers: set[int], error: int = errno.ENXIO, funcs: int = I2C_AND_SMBUS) -> None:
        self.answers, self.error, self.funcs = answers, error, funcs
        self.is_open, self.rejects_empty = True, False
        self.fd = os.open(os.devnull, os.O_RDONLY)
        self.addressed: list[int] = []

    def i2c_rdwr(self, message: Any) -> None:
        """Accept a transfer to a board, and fail for other addresses; optionally, refuse transfers without data."""
        self.addressed.append(message.addr)
        if self.rejects_empty and not message.len:
            raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))
        if message.addr not in self.answers:
            raise OSError(self.error, os.strerror(self.error))

    def close(self) -> None:
        self.is_open = False
        os.close(self.fd)


@pytest.fixture(autouse=True)
def short_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the search for boards end after 10 ms."""
    monkeypatch.setattr("taxel.link.linux_hub.adapter.BOARD_TIMEOUT_S", 0.01)


def check_one_line(error: BaseException, *parts: str) -> None:
    """Check that the text of an exception has one line and contains all `parts`."""
    assert "\n" not in str(error)
    for part in parts:
        assert part in str(error)


def test_url_states_device_addresses_and_clock() -> None:
    parts = parse_i2c_url("i2c:///dev/i2c-1?boards=auto")
    assert (parts.device, parts.scl_hz) == ("/dev/i2c-1", None)
    assert parts.addresses == tuple(range(0x08, 0x78))
    parts = parse_i2c_url("i2c:///dev/i2c-11?boards=0x1C,29&scl_hz=400000")
    assert (parts.device, parts.addresses, parts.scl_hz) == ("/dev/i2c-11", (0x1C, 0x1D), 400e3)
    assert parse_i2c_url("/dev/i2c-1").device == "/dev/i2c-1"


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("i2c:", "names no I2C adapter; expected i2c:///dev/i2c-1"),
        ("i2c:///dev/ttyUSB0", "names no I2C adapter"),
        ("i2c:///dev/i2c-", "names no I2C adapter"),
        ("i2c:///dev/i2c-1?bords=auto", "unknown option 'bords'; known are boards, scl_hz"),
        ("i2c:///dev/i2c-1?boards=", "option 'boards' must be auto, or addresses from 0x08 to 0x77"),
        ("i2c:///dev/i2c-1?boards=0x78", "option 'boards' must be auto"),
        ("i2c:///dev/i2c-1?boards=palm", "found 'palm'"),
        ("i2c:///dev/i2c-1?scl_hz=fast", "option 'scl_hz' must be a number from 10000 to 5000000, found 'fast'"),
    ],
)
def test_wrong_url_gives_one_error_line(url: str, expected: str) -> None:
    with pytest.raises(LinkError) as caught:
        open_link(url)
    check_one_line(caught.value, url, expected)


def test_missing_adapter_gives_one_error_line_with_the_command_that_loads_the_driver() -> None:
    for url in ("i2c:///dev/i2c-99", "/dev/i2c-99"):
        with pytest.raises(PortMissingError) as caught:
            open_link(url)
        check_one_line(caught.value, "/dev/i2c-99: cannot be opened (No such file", "modprobe i2c-dev")


def test_missing_permission_gives_one_error_line_that_names_the_group(monkeypatch: pytest.MonkeyPatch) -> None:
    def reject(device: str) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(smbus2, "SMBus", reject)
    with pytest.raises(PortMissingError) as caught:
        open_link("i2c:///dev/i2c-1")
    check_one_line(caught.value, "/dev/i2c-1: cannot be opened (Permission denied)", "group i2c")


def test_missing_smbus2_gives_one_error_line_with_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "smbus2", None)
    with pytest.raises(MissingPackageError) as caught:
        open_link("i2c:///dev/i2c-1")
    check_one_line(caught.value, "/dev/i2c-1", "pip install 'taxel[i2c]'")


def test_adapter_without_plain_transfers_is_rejected_and_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    adapter = FakeAdapter({0x1C}, funcs=SMBUS_ONLY)
    monkeypatch.setattr(smbus2, "SMBus", lambda device: adapter)
    with pytest.raises(LinkError) as caught:
        open_adapter("/dev/i2c-1")
    check_one_line(caught.value, "/dev/i2c-1: the adapter transfers SMBus commands only", "I2C_FUNC_I2C")
    assert not adapter.is_open


@pytest.mark.parametrize(
    ("addresses", "expected"),
    [
        (tuple(range(8, 0x78)), "no board answers at any address"),
        ((0x1C,), "no board answers at 0x1C; check power"),
        ((0x1C, 0x1D), "no board answers at 0x1C, 0x1D"),
    ],
)
def test_bus_without_boards_gives_one_error_line(addresses: tuple[int, ...], expected: str) -> None:
    with pytest.raises(LinkError) as caught:
        check_board_answers(FakeAdapter(set()), "/dev/i2c-1", addresses)
    check_one_line(caught.value, expected, "i2cdetect -y 1")


def test_search_for_boards_addresses_no_other_device_of_the_bus() -> None:
    adapter = FakeAdapter(set())
    with pytest.raises(LinkError):
        check_board_answers(adapter, "/dev/i2c-1", (0x1C, 0x1D))
    assert set(adapter.addressed) == {0x1C, 0x1D}


@pytest.mark.parametrize(("error", "name"), [(errno.EBUSY, "EBUSY"), (errno.ETIMEDOUT, "ETIMEDOUT")])
def test_held_line_gives_an_error_line_of_its_own_instead_of_that_of_a_missing_board(error: int, name: str) -> None:
    with pytest.raises(LinkError) as caught:
        check_board_answers(FakeAdapter(set(), error), "/dev/i2c-1", (0x1C,))
    check_one_line(caught.value, f"'{name}': SDA or SCL is held low")


def test_adapter_that_is_unplugged_during_the_search_gives_one_error_line() -> None:
    with pytest.raises(LinkError) as caught:
        check_board_answers(FakeAdapter(set(), errno.ENODEV), "/dev/i2c-1", (0x1C,))
    check_one_line(caught.value, "/dev/i2c-1: the adapter is gone")


def test_boards_are_found_by_an_adapter_that_rejects_transfers_without_data() -> None:
    adapter = FakeAdapter({0x1C})
    adapter.rejects_empty = True
    check_board_answers(adapter, "/dev/i2c-1", (0x1C,))


def test_adapter_is_closed_after_a_search_without_a_board(monkeypatch: pytest.MonkeyPatch) -> None:
    adapter = FakeAdapter(set())
    monkeypatch.setattr(i2c_url, "open_adapter", lambda device: adapter)
    with pytest.raises(LinkError, match="no board answers"):
        open_link("i2c:///dev/i2c-1")
    assert not adapter.is_open


def test_bus_clock_is_that_of_the_device_tree_or_100_khz(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taxel.link.linux_hub.adapter._SYSFS", tmp_path)
    assert read_scl_hz("/dev/i2c-1") == 100e3
    node = tmp_path / "i2c-1" / "of_node"
    node.mkdir(parents=True)
    (node / "clock-frequency").write_bytes((400_000).to_bytes(4, "big"))
    assert read_scl_hz("/dev/i2c-1") == 400e3


def read_until_failure(link: LinuxHubLink) -> None:
    """Read a link until it raises, at most 100 times: the handshake after the start precedes the failure."""
    for _ in range(100):
        link.read(0.1)


def test_failure_of_the_adapter_ends_the_link_with_one_error_line() -> None:
    # A file that is no adapter rejects the first transfer.
    with Path("/dev/null").open("rb") as file:
        link = LinuxHubLink(SimpleNamespace(fd=file.fileno(), close=lambda: None), "/dev/i2c-1", 400e3, (0x1C,))
        try:
            with pytest.raises(PortVanishedError) as caught:
                read_until_failure(link)
            check_one_line(caught.value, "/dev/i2c-1: the adapter is gone")
            with pytest.raises(PortVanishedError):
                link.write(b"x")
        finally:
            link.close()
            link.close()
