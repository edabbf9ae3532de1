"""A serial port through pyserial: device names, and the URLs of pyserial (socket://, rfc2217://, loop://)."""

import contextlib
import os
import re
import time

import serial

from taxel.link.base import Chunk
from taxel.link.errors import LinkError, PortMissingError, PortVanishedError
from taxel.link.port_lock import BUSY, make_busy_error, refuse_other_openings

READ_SIZE = 4096
WRITE_TIMEOUT_S = 2.0


class SerialLink:
    """A serial port with 8 data bits, no parity and one stop bit, as a link.

    A device is locked for this program, because two readers would each receive a part of the bytes.
    """

    is_real_time = True
    is_recorded = False

    def __init__(self, port: str, baud: float = 1e6, rtscts: bool | None = None, low_latency: bool = True) -> None:
        """Open and lock a serial port.

        port: device (`/dev/ttyUSB0`) or pyserial URL. baud: bits per second. rtscts: hardware flow control. True: both
        lines are wired to the hub, so that the hub can stop the host (`has_flow_control`); a port without these lines
        is rejected. None: used if the port has the lines. False: not used. low_latency: set the 1 ms mode of the driver
        if available. Raises PortMissingError if the port cannot be opened with these settings, and PortBusyError if
        another program uses the port.
        """
        self.name = port
        self.baud = baud
        self.has_flow_control = rtscts is True
        self._failure: Exception | None = None
        is_device = "://" not in port
        try:
            self._port = serial.serial_for_url(
                port,
                baudrate=int(baud),
                timeout=0.1,
                write_timeout=WRITE_TIMEOUT_S,
                exclusive=True if is_device else None,  # locked before the settings of the other program are changed
            )
        except (
            serial.SerialException,
            OSError,
            ValueError,
            LookupError,
            re.error,
        ) as error:  # what pyserial lets through
            if is_device and isinstance(error, OSError) and error.errno in BUSY and os.access(port, os.R_OK | os.W_OK):
                raise make_busy_error(port) from None
            raise PortMissingError(
                port, f"cannot be opened ({_describe(error)}); is the hub plugged in and powered?"
            ) from error
        if is_device and isinstance(self._port, serial.Serial):
            refuse_other_openings(self._port.fileno(), port)
        self._prepare(rtscts, low_latency)

    def _prepare(self, rtscts: bool | None, low_latency: bool) -> None:
        """Set flow control and low latency of the open serial port; arguments as for the constructor.

        Raises PortMissingError, and closes the port, if flow control is required and not available.
        """
        # A pseudo-terminal has no modem lines, and many drivers have no low-latency mode: both settings may fail.
        unsupported = (serial.SerialException, OSError, ValueError, NotImplementedError)
        try:
            self._port.rtscts = rtscts is not False
        except unsupported:
            if rtscts:
                self.close()
                raise PortMissingError(
                    self.name, "has no RTS and CTS, which rtscts=1 requires; leave rtscts out, or use another adapter"
                ) from None
            with contextlib.suppress(*unsupported):
                self._port.rtscts = False  # otherwise every later setting fails with this error
        if low_latency and hasattr(self._port, "set_low_latency_mode"):
            with contextlib.suppress(*unsupported):
                self._port.set_low_latency_mode(True)

    def read(self, timeout_s: float) -> Chunk | None:
        """Return the received bytes of the serial port, waiting at most `timeout_s` seconds for the first byte.

        Returns None if no byte arrives. Raises `PortVanishedError` if the port has been removed.
        """
        if self._failure is not None:
            raise self._make_vanished_error(self._failure)
        data = b""
        try:
            if self._port.timeout != timeout_s:
                self._port.timeout = timeout_s
            data = self._port.read(1)
            arrival = time.monotonic_ns()
            if data:
                data += self._read_waiting()
        except (serial.SerialException, OSError, TypeError) as error:
            if not data:
                raise self._make_vanished_error(error) from error
            self._failure = error  # raised by the next call, after the received bytes are returned
        return Chunk(data, arrival) if data else None

    def _read_waiting(self) -> bytes:
        """Return the bytes that the operating system has received on the serial port, without waiting for more."""
        waiting = self._port.in_waiting
        if not waiting:
            return b""
        if waiting > 1 or isinstance(self._port, serial.Serial):
            return bytes(self._port.read(min(waiting, READ_SIZE)))
        # A socket reports only that bytes are waiting, not how many: read all of them without waiting for more.
        timeout_s, self._port.timeout = self._port.timeout, 0
        try:
            return bytes(self._port.read(READ_SIZE))
        finally:
            self._port.timeout = timeout_s

    def _make_vanished_error(self, error: Exception) -> PortVanishedError:
        """Create the error for a serial port that has been removed; error: exception of pyserial."""
        return PortVanishedError(self.name, f"the port is gone ({_describe(error)}); check plug and power")

    def write(self, data: bytes) -> None:
        """Send all bytes to the serial port.

        Raises `LinkError` if the hub accepts no bytes for `WRITE_TIMEOUT_S`, `PortVanishedError` if the port has been
        removed.
        """
        try:
            self._port.write(data)
        except serial.SerialTimeoutException as error:
            raise LinkError(self.name, "the hub accepts no bytes (flow control); check that it is powered") from error
        except (serial.SerialException, OSError) as error:
            raise PortVanishedError(
                self.name, f"the port is gone ({_describe(error)}); check plug and power"
            ) from error

    def close(self) -> None:
        """Close the serial port; errors of a port that has been removed are ignored."""
        with contextlib.suppress(serial.SerialException, OSError):
            self._port.close()


def _describe(error: BaseException) -> str:
    """Describe an exception in one line: the operating system's text for its error number, else its message or type."""
    text = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
    return text.splitlines()[0] if text else type(error).__name__
