"""A serial port gives every byte that arrived, and says when it is gone."""

import contextlib
import os
import socket
import threading
import time

import pytest
import serial

from taxel.link import LinkError, PortMissingError, PortVanishedError, SerialLink, open_link

EVERY_BYTE = bytes(range(256))
PATIENCE_S = 20.0


@pytest.fixture
def listener():
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(PATIENCE_S)
        yield server


def url_of(server):
    return f"socket://127.0.0.1:{server.getsockname()[1]}"


def write_all(descriptor, data):
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]


def read_until_gone(link):
    """(bytes, the text of the error at the end)."""
    data = b""
    deadline = time.monotonic() + PATIENCE_S
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


def test_silence_is_none_and_not_an_error(terminal):
    link = SerialLink(terminal.name)
    assert link.read(0.01) is None
    link.close()


def test_a_burst_of_a_megabyte_arrives_whole_and_in_order(terminal, read_bytes):
    data = os.urandom(1 << 20)
    link = SerialLink(terminal.name)
    writer = threading.Thread(target=write_all, args=(terminal.master, data))
    writer.start()
    assert read_bytes(link, len(data)) == data
    writer.join(PATIENCE_S)
    assert link.read(0.0) is None
    link.close()


def test_arrival_times_never_go_back_and_lie_between_call_and_return(terminal):
    link = SerialLink(terminal.name)
    times = [time.monotonic_ns()]
    for i in range(20):
        os.write(terminal.master, bytes([i]))
        chunk = link.read(PATIENCE_S)
        assert chunk is not None
        times += [chunk.arrival_ns, time.monotonic_ns()]
    assert times == sorted(times)
    link.close()


def test_a_vanished_port_is_named_after_what_had_arrived(terminal, read_bytes):
    link = SerialLink(terminal.name)
    os.write(terminal.master, b"last words")
    assert read_bytes(link, 10) == b"last words"
    terminal.vanish()
    rest, text = read_until_gone(link)
    assert rest == b""
    assert text.startswith(f"{terminal.name}: the port is gone")
    assert "\n" not in text
    with pytest.raises(PortVanishedError):
        link.write(b"hello?")
    link.close()
    link.close()


@pytest.mark.parametrize("size", [1, 2, 3, 4095, 4096, 4097, 10_001])
def test_no_byte_is_lost_when_the_other_end_closes(listener, size):
    data = os.urandom(size)
    link = open_link(url_of(listener))
    connection, _ = listener.accept()
    connection.sendall(data)
    connection.close()
    received, text = read_until_gone(link)
    assert received == data
    assert text.startswith(url_of(listener))
    link.close()


class PortOnTheBrink:
    """A port that gives one byte, and is then unplugged before anybody has asked how many more there are."""

    timeout = 0.1
    rtscts = False

    def __init__(self):
        self._left = b"x"

    def read(self, size):
        data, self._left = self._left, b""
        if not data:
            raise serial.SerialException("device reports readiness to read but returned no data")
        return data

    @property
    def in_waiting(self):
        raise OSError(5, "Input/output error")

    def close(self):
        pass


def test_a_byte_read_just_before_the_port_went_is_delivered(monkeypatch):
    monkeypatch.setattr(serial, "serial_for_url", lambda *args, **kwargs: PortOnTheBrink())
    link = SerialLink("/dev/ttyUSB0")
    received, text = read_until_gone(link)
    assert received == b"x"
    assert text.startswith("/dev/ttyUSB0: the port is gone")


class PortWithoutModemLines:
    """A port whose driver refuses hardware flow control, each time that it is configured anew."""

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

    def set_low_latency_mode(self, wanted):
        raise OSError(25, "Inappropriate ioctl for device")

    def read(self, size):
        return b"x"


def test_flow_control_and_low_latency_are_offers_and_not_conditions(monkeypatch):
    monkeypatch.setattr(serial, "serial_for_url", lambda *args, **kwargs: PortWithoutModemLines())
    link = SerialLink("/dev/ttyUSB0", low_latency=True)
    assert link.read(0.5).data == b"x"
    assert not link.holds_back


def test_flow_control_that_was_asked_for_is_a_condition(monkeypatch):
    monkeypatch.setattr(serial, "serial_for_url", lambda *args, **kwargs: PortWithoutModemLines())
    with pytest.raises(PortMissingError, match="/dev/ttyUSB0: has no RTS and CTS, which rtscts=1 asks for"):
        SerialLink("/dev/ttyUSB0", rtscts=True)


@pytest.mark.parametrize("rtscts", [False, None])
@pytest.mark.parametrize("low_latency", [False, True])
def test_a_pseudo_terminal_works_with_or_without_offers(terminal, read_bytes, rtscts, low_latency):
    link = SerialLink(terminal.name, rtscts=rtscts, low_latency=low_latency)
    os.write(terminal.master, b"here")
    assert read_bytes(link, 4) == b"here"
    link.close()


def test_a_hub_that_takes_no_bytes_is_an_error_and_not_a_wait_for_ever(terminal):
    link = SerialLink(terminal.name)
    caught = []

    def write():
        try:
            link.write(bytes(1 << 20))
        except LinkError as error:
            caught.append(str(error))

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    writer.join(PATIENCE_S / 2)
    still_waiting = writer.is_alive()
    terminal.vanish()  # lets a writer that waits go
    writer.join(PATIENCE_S)
    assert not still_waiting
    assert "takes no bytes" in caught[0]
    assert caught[0].startswith(terminal.name)


def test_a_port_that_is_not_there_says_so():
    with pytest.raises(PortMissingError) as caught:
        SerialLink("/dev/ttyNOPE")
    assert str(caught.value).startswith("/dev/ttyNOPE: cannot be opened")
    assert "\n" not in str(caught.value)


def test_a_loop_gives_back_what_it_is_sent(read_bytes):
    link = open_link("loop://")
    link.write(EVERY_BYTE)
    assert read_bytes(link, 256) == EVERY_BYTE
    assert link.read(0.0) is None
    link.close()


def test_a_socket_is_as_good_as_a_port(listener, read_bytes):
    data = os.urandom(200_000)
    link = open_link(url_of(listener))
    connection, _ = listener.accept()
    with contextlib.closing(connection):
        link.write(EVERY_BYTE)
        assert connection.recv(1000) == EVERY_BYTE
        sender = threading.Thread(target=connection.sendall, args=(data,))
        sender.start()
        assert read_bytes(link, len(data)) == data
        sender.join(PATIENCE_S)
    link.close()


def test_a_socket_that_nobody_serves_is_a_missing_port(listener):
    url = url_of(listener)
    listener.close()
    with pytest.raises(PortMissingError) as caught:
        open_link(url)
    assert str(caught.value).startswith(url)
