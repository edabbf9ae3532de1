"""The UART of a board under bring-up: bytes to the board, lines from it."""

import time
from typing import Final, Protocol

from taxel.link.serial_port import SerialLink
from taxel_tools.bringup.lines import Line, parse_line

BAUD: Final = 115_200
SLICE_S: Final = 0.05
FAULT: Final = "fault"
"""Name of the line that the image prints after an exception."""


class BytePort(Protocol):
    """A connection to the UART of a board. now_s: time of the connection's clock, seconds."""

    name: str

    def now_s(self) -> float:
        """Return the time of this connection's clock in seconds."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes to the board. Raises `LinkError`."""
        ...

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that arrive within `timeout_s`, without waiting for more once some have arrived."""
        ...

    def close(self) -> None:
        """Close the connection."""
        ...


class SerialBytePort:
    """A serial port at 115,200 baud. Raises `PortMissingError` and `PortBusyError` as `SerialLink` does."""

    def __init__(self, device: str) -> None:
        """Open the port. device: path of the device, or a URL of pyserial."""
        self.name = device
        self._link = SerialLink(device, BAUD, rtscts=False)

    def now_s(self) -> float:
        """Return the seconds of the monotonic clock."""
        return time.monotonic()

    def write(self, data: bytes) -> None:
        """Send bytes to the board. Raises `LinkError`."""
        self._link.write(data)

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that arrive within `timeout_s`; empty if none arrive."""
        chunk = self._link.read(timeout_s)
        return b"" if chunk is None else chunk.data

    def close(self) -> None:
        """Close the port."""
        self._link.close()


class LineReader:
    """Reader of lines from a byte port. received: all bytes since the creation."""

    def __init__(self, port: BytePort) -> None:
        """Read the lines of an open port."""
        self._port = port
        self._rest = b""
        self.received = b""

    def send(self, command: str) -> None:
        """Send a command."""
        self._port.write(command.encode())

    def send_bytes(self, data: bytes) -> None:
        """Send bytes."""
        self._port.write(data)

    def read_line(self, timeout_s: float) -> Line | None:
        """Return the next line that is not empty, or None if none ends within `timeout_s`."""
        end = self._port.now_s() + timeout_s
        while True:
            while b"\n" in self._rest:
                text, self._rest = self._rest.split(b"\n", 1)
                line = parse_line(text.decode("ascii", errors="replace"), self._port.now_s())
                if line is not None:
                    return line
            remaining = end - self._port.now_s()
            if remaining <= 0:
                return None
            data = self._port.read(min(remaining, SLICE_S))
            self.received += data
            self._rest += data

    def read_until(self, name: str, timeout_s: float) -> list[Line]:
        """Return the lines up to the first with this name, or to a fault line of the image, which is then the last
        line.

        timeout_s: longest wait for each line; after it, the lines so far are returned. The line "ready", which a
        waiting image repeats, is omitted and does not extend the time.
        """
        lines: list[Line] = []
        end = self._port.now_s() + timeout_s
        while (line := self.read_line(end - self._port.now_s())) is not None:
            if line.name == "ready":
                continue
            end = self._port.now_s() + timeout_s
            lines.append(line)
            if line.name in (name, FAULT):
                break
        return lines
