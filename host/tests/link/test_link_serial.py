"""Serial ports: every received byte is delivered, and an unplugged, missing or blocked port raises a one-line error."""

import contextlib
import os
import socket
import threading
import time

import pytest
import serial

from taxel.link import LinkError, PortMissingError, PortVanishedError, SerialLink, open_link

EVERY_BYTE = bytes(range(256))
TIMEOUT_S = 20.0


@pytest.fixture
def server():
    """A listening TCP socket."""
    with socket.create_server(("127.0.0.1", 0)) as listening_socket:
        listening_socket.settimeout(TIMEOUT_S)
        yield listening_socket


def make_url(server):
    """Return the URL of a socket link to the server."""
    return f"socket://127.0.0.1:{server.getsockname()[1]}"


def write_all(descriptor, data):
    """Write all bytes to a file descriptor, also if one call accepts only a part of them."""
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]


def read_until_vanished(link):
    """Read a link until its port vanishes; return all bytes, and the text of the error."""
    data = b""
    deadline = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline:
        try:
            chunk = link.read(0.1)
        except PortVanishedError as end:
            return data, str(end)
        data += chunk.data if chunk else b""
    raise AssertionError("the port has not gone")


def test_every_byte_value_passes_both_ways_unchanged(terminal, read_bytes):
    link = SerialLink(terminal.name)
    os.write(terminal.master, EVERY_BYTE)
    assert read_bytes(link, 256) == EVERY_BYTE
    link.write(EVERY_BYTE)
    assert os.read(terminal.master, 1000) == EVERY_BYTE
    link.close()


def test_a_read_without_data_returns_none(terminal):
    link = SerialLink(terminal.name)
    assert link.read(0.01) is None
    link.close()


def test_a_burst_of_a_megabyte_is_received_completely_and_in_order(terminal, read_bytes):
    data = os.urandom(1 << 20)
    link = SerialLink(terminal.name)
    writer = threading.Thread(target=write_all, args=(terminal.master, data))
    writer.start()
    assert read_bytes(link, len(data)) == data
    writer.join(TIMEOUT_S)
    assert link.read(0.0) is None
    link.close()


def test_arrival_times_increase_and_lie_between_call_and_return_of_read(terminal):
    link = SerialLink(terminal.name)
    times = [time.monotonic_ns()]
    for i in range(20):
        os.write(terminal.master, bytes([i]))
        chunk = link.read(TIMEOUT_S)
        assert chunk is not None
        times += [chunk.arrival_ns, time.monotonic_ns()]
    assert times == sorted(times)
    link.close()


def test_an_unplugged_port_is_reported_after_its_last_bytes(terminal, read_bytes):
    link = SerialLink(terminal.name)
    os.write(terminal.master, b"last words")
    assert read_bytes(link, 10) == b"last words"
    terminal.unplug()
    further_bytes, text = read_until_vanished(link)
    assert further_bytes == b""
    assert text.startswith(f"{terminal.name}: the port is gone")
    assert "\n" not in text
    with pytest.raises(PortVanishedError):
        link.write(b"request")
    link.close()
    link.close()


@pytest.mark.parametrize("size", [1, 2, 3, 4095, 4096, 4097, 10_001])
def test_no_byte_is_lost_when_the_other_end_closes(server, size):
    data = os.urandom(size)
    link = open_link(make_url(server))
    connection, _ = server.accept()
    connection.sendall(data)
    connection.close()
    received, text = read_until_vanished(link)
    assert received == data
    assert text.startswith(make_url(server))
    link.close()


class PortUnpluggedAfterOneByte:
    """A port that gives one byte and is unplugged before the number of waiting bytes is read."""

    timeout = 0.1
    rtscts = False

    def __init__(self):
        self._remaining = b"x"

    def read(self, size):
        data, self._remaining = self._remaining, b""
        if not data:
            raise serial.SerialException("device reports readiness to read but returned no data")
        return data

    @property
    def in_waiting(self):
        raise OSError(5, "Input/output error")

    def close(self):
        pass


def test_a_byte_read_just_before_the_port_is_unplugged_is_delivered(monkeypatch):
    monkeypatch.setattr(serial, "serial_for_url", lambda *args, **kwargs: PortUnpluggedAfterOneByte())
    link = SerialLink("/dev/ttyUSB0")
    received, text = read_until_vanished(link)
    assert received == b"x"
    assert text.startswith("/dev/ttyUSB0: the port is gone")


class PortWithoutModemLines:
    """A port whose driver refuses hardware flow control at every configuration."""

    def __init__(self):
        self._settings = {"rtscts": False, "timeout": 0.1}

    def __getattr__(self, name):
        return self._settings[name]

    def __setattr__(self, name, value):
        if name == "_settings":
            object.__setattr__(self, name, value)
            return
        self._settings[name] = value
        if self._settings["rtscts"]:
            raise serial.SerialException("Could not configure port: (22, 'Invalid argument')")

    in_waiting = 0

    def close(self):
        pass

    def set_low_latency_mode(self, enabled):
        raise OSError(25, "Inappropriate ioctl for device")

    def read(self, size):
        return b"x"


def test_a_port_without_modem_lines_works_without_flow_control_and_low_latency(monkeypatch):
    monkeypatch.setattr(serial, "serial_for_url", lambda *args, **kwargs: PortWithoutModemLines())
    link = SerialLink("/dev/ttyUSB0", low_latency=True)
    assert link.read(0.5).data == b"x"
    assert not link.has_flow_control


def test_requested_flow_control_is_refused_by_a_port_without_modem_lines(monkeypatch):
    monkeypatch.setattr(serial, "serial_for_url", lambda *args, **kwargs: PortWithoutModemLines())
    with pytest.raises(PortMissingError, match="/dev/ttyUSB0: has no RTS and CTS, which rtscts=1 requires"):
        SerialLink("/dev/ttyUSB0", rtscts=True)


@pytest.mark.parametrize("rtscts", [False, None])
@pytest.mark.parametrize("low_latency", [False, True])
def test_a_pseudo_terminal_works_with_any_default_of_flow_control_and_latency(
    terminal, read_bytes, rtscts, low_latency
):
    link = SerialLink(terminal.name, rtscts=rtscts, low_latency=low_latency)
    os.write(terminal.master, b"here")
    assert read_bytes(link, 4) == b"here"
    link.close()


def test_writing_to_a_hub_that_accepts_no_bytes_raises_an_error_in_time(terminal):
    link = SerialLink(terminal.name)
    errors = []

    def write_megabyte():
        try:
            link.write(bytes(1 << 20))
        except LinkError as error:
            errors.append(str(error))

    writer = threading.Thread(target=write_megabyte, daemon=True)
    writer.start()
    writer.join(TIMEOUT_S / 2)
    is_still_waiting = writer.is_alive()
    terminal.unplug()  # ends a write that still waits
    writer.join(TIMEOUT_S)
    assert not is_still_waiting
    assert "accepts no bytes" in errors[0]
    assert errors[0].startswith(terminal.name)


def test_a_missing_port_gives_one_error_line():
    with pytest.raises(PortMissingError) as caught:
        SerialLink("/dev/ttyNOPE")
    assert str(caught.value).startswith("/dev/ttyNOPE: cannot be opened")
    assert "\n" not in str(caught.value)


def test_a_loop_port_returns_the_bytes_sent(read_bytes):
    link = open_link("loop://")
    link.write(EVERY_BYTE)
    assert read_bytes(link, 256) == EVERY_BYTE
    assert link.read(0.0) is None
    link.close()


def test_a_socket_passes_bytes_both_ways_unchanged(server, read_bytes):
    data = os.urandom(200_000)
    link = open_link(make_url(server))
    connection, _ = server.accept()
    with contextlib.closing(connection):
        link.write(EVERY_BYTE)
        assert connection.recv(1000) == EVERY_BYTE
        sender = threading.Thread(target=connection.sendall, args=(data,))
        sender.start()
        assert read_bytes(link, len(data)) == data
        sender.join(TIMEOUT_S)
    link.close()


def test_a_socket_without_a_server_is_reported_as_a_missing_port(server):
    url = make_url(server)
    server.close()
    with pytest.raises(PortMissingError) as caught:
        open_link(url)
    assert str(caught.value).startswith(url)
