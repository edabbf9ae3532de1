"""A serial port, through pyserial: device names, and every URL that pyserial itself knows (socket://, rfc2217://,
loop://).
"""

import contextlib
import time

import serial

from taxel.link.base import Chunk
from taxel.link.errors import LinkError, PortMissingError, PortVanishedError

READ_SIZE = 4096


class SerialLink:
    """Bytes of a serial port, 8N1.

    Parameters: `port` is a device (`/dev/ttyUSB0`) or a pyserial URL; `baud` in bits a second; `rtscts` asks for
    hardware flow control and `low_latency` for the driver's 1 ms mode: where a port has neither, it is used without.
    Raises `PortMissingError` if the port cannot be opened.
    """

    is_real_time = True
    is_recorded = False

    def __init__(self, port: str, baud: float = 1e6, rtscts: bool = True, low_latency: bool = True) -> None:
        self.name = port
        self.baud = baud
        try:
            self._port = serial.serial_for_url(port, baudrate=int(baud), timeout=0.1, exclusive=None)
        except (serial.SerialException, OSError, ValueError) as error:
            raise PortMissingError(
                port, f"cannot be opened ({_reason(error)}); is the hub plugged in and powered?"
            ) from error
        self._prepare(rtscts, low_latency)

    def _prepare(self, rtscts: bool, low_latency: bool) -> None:
        # A pseudo-terminal has no modem lines, many drivers have no low-latency mode: both are offers, not conditions.
        with contextlib.suppress(serial.SerialException, OSError, ValueError, NotImplementedError):
            self._port.rtscts = rtscts
        if low_latency and hasattr(self._port, "set_low_latency_mode"):
            with contextlib.suppress(serial.SerialException, OSError, ValueError, NotImplementedError):
                self._port.set_low_latency_mode(True)

    def read(self, timeout_s: float) -> Chunk | None:
        """Whatever is there, waiting at most `timeout_s` seconds for the first byte."""
        try:
            if self._port.timeout != timeout_s:
                self._port.timeout = timeout_s
            data = self._port.read(1)
            arrival = time.monotonic_ns()
            waiting = self._port.in_waiting
            if data and waiting:
                data += self._port.read(min(waiting, READ_SIZE))
        except (serial.SerialException, OSError, TypeError) as error:
            raise PortVanishedError(self.name, f"the port is gone ({_reason(error)}); check plug and power") from error
        return Chunk(data, arrival) if data else None

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
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return text.splitlines()[0] if text else type(error).__name__
