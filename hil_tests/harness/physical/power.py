"""Power of the whole rig, switched by a modem line of a serial port that drives a transistor or a relay."""

import contextlib

import serial

from hil_tests.harness.errors import RigError

LINES = ("rts", "dtr")


class ModemLinePower:
    """RTS or DTR of `port` switches hub and boards together; no board can be switched alone.

    A port of its own, not the hub's: opening a port moves its modem lines.
    """

    def __init__(self, port: str, line: str = "rts", on_is_high: bool = True) -> None:
        if line not in LINES:
            raise RigError(f"power {port}: line = '{line}'; expected {' or '.join(LINES)}")
        self._line, self._on_is_high, self._name = line, on_is_high, port
        try:
            self._port = serial.serial_for_url(port)
            self.switch(True)
        except (serial.SerialException, OSError, ValueError) as error:
            raise RigError(f"power {port}: cannot be opened ({error}); is the switch plugged in?") from None

    def switch(self, on: bool, address: int | None = None) -> None:
        if address is not None:
            raise RigError(f"power {self._name}: board 0x{address:02X} cannot be switched alone; switch the whole rig")
        setattr(self._port, self._line, on == self._on_is_high)

    def close(self) -> None:
        with contextlib.suppress(serial.SerialException, OSError):
            self.switch(True)
            self._port.close()
