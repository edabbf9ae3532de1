"""A serial port, through pyserial: device names, and every URL that pyserial itself knows (socket://, rfc2217://,
loop://).
"""

import contextlib
import os
import re
import time

import serial

from taxel.link.base import Chunk
from taxel.link.errors import LinkError, PortMissingError, PortVanishedError

READ_SIZE = 4096
WRITE_TIMEOUT_S = 2.0


class SerialLink:
    """Bytes of a serial port, 8N1.

    Parameters: `port` is a device (`/dev/ttyUSB0`) or a pyserial URL; `baud` in bits a second; `low_latency` asks for
    the driver's 1 ms mode, if it has one. `rtscts`: hardware flow control. True says that both lines are wired, so the
    hub makes this side wait (`holds_back`), and a port without them is refused; None takes it where a port has it.
    Raises `PortMissingError` if the port cannot be opened as asked.
    """

    is_real_time = True
    is_recorded = False

    def __init__(self, port: str, baud: float = 1e6, rtscts: bool | None = None, low_latency: bool = True) -> None:
        self.name = port
        self.baud = baud
        self.holds_back = rtscts is True
        self._failure: Exception | None = None
        try:
            self._port = serial.serial_for_url(
                port, baudrate=int(baud), timeout=0.1, write_timeout=WRITE_TIMEOUT_S, exclusive=None
            )
        except (
            serial.SerialException,
            OSError,
            ValueError,
            LookupError,
            re.error,
        ) as error:  # what pyserial lets through
            raise PortMissingError(
                port, f"cannot be opened ({_reason(error)}); is the hub plugged in and powered?"
            ) from error
        self._prepare(rtscts, low_latency)

    def _prepare(self, rtscts: bool | None, low_latency: bool) -> None:
        # A pseudo-terminal has no modem lines, many drivers no low-latency mode: offers, unless asked for.
        refusals = (serial.SerialException, OSError, ValueError, NotImplementedError)
        try:
            self._port.rtscts = rtscts is not False
        except refusals:
            if rtscts:
                self.close()
                raise PortMissingError(
                    self.name, "has no RTS and CTS, which rtscts=1 requires; leave rtscts out, or use another adapter"
                ) from None
            with contextlib.suppress(*refusals):
                self._port.rtscts = False  # or every later setting would fail with it
        if low_latency and hasattr(self._port, "set_low_latency_mode"):
            with contextlib.suppress(*refusals):
                self._port.set_low_latency_mode(True)

    def read(self, timeout_s: float) -> Chunk | None:
        """Whatever is there, waiting at most `timeout_s` seconds for the first byte."""
        if self._failure is not None:
            raise self._vanished(self._failure)
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
                raise self._vanished(error) from error
            self._failure = error  # first what had arrived
        return Chunk(data, arrival) if data else None

    def _read_waiting(self) -> bytes:
        waiting = self._port.in_waiting
        if not waiting:
            return b""
        if waiting > 1 or isinstance(self._port, serial.Serial):
            return bytes(self._port.read(min(waiting, READ_SIZE)))
        # A socket only tells that there is something: take all of it, without waiting for more.
        timeout_s, self._port.timeout = self._port.timeout, 0
        try:
            return bytes(self._port.read(READ_SIZE))
        finally:
            self._port.timeout = timeout_s

    def _vanished(self, error: Exception) -> PortVanishedError:
        return PortVanishedError(self.name, f"the port is gone ({_reason(error)}); check plug and power")

    def write(self, data: bytes) -> None:
        """Send all bytes."""
        try:
            self._port.write(data)
        except serial.SerialTimeoutException as error:
            raise LinkError(self.name, "the hub takes no bytes (flow control); is it powered?") from error
        except (serial.SerialException, OSError) as error:
            raise PortVanishedError(self.name, f"the port is gone ({_reason(error)}); check plug and power") from error

    def close(self) -> None:
        """Close the port."""
        with contextlib.suppress(serial.SerialException, OSError):
            self._port.close()


def _reason(error: BaseException) -> str:
    text = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
    return text.splitlines()[0] if text else type(error).__name__
