"""Power supply switched by a modem line of a serial port, which drives a transistor or a relay."""

import contextlib

import serial

from hil_tests.harness.context import DriverContext
from hil_tests.harness.errors import RigError
from hil_tests.harness.interfaces import Power

LINES = ("rts", "dtr")


class ModemLinePower(Power):
    """RTS or DTR of `port` switches hub and boards together; a board cannot be switched alone.

    `port` is not the port of the hub, because opening a port changes its modem lines. Raises `RigError` for another
    line, or if the port cannot be opened. The power is on after opening and after closing.
    """

    def __init__(self, context: DriverContext, port: str, line: str = "rts", on_is_high: bool = True) -> None:
        """Open the serial port whose output switches the power supply of the rig, and switch the power on.

        port: name or URL of the serial port. line: the output that switches, "rts" or "dtr". on_is_high: whether
        the power is on while the output is active. Raises `RigError` if the port cannot be opened.
        """
        if line not in LINES:
            raise RigError(f"power {port}: line = '{line}'; expected {' or '.join(LINES)}")
        self._line, self._on_is_high, self._name = line, on_is_high, port
        try:
            self._port = serial.serial_for_url(port)
            self.switch(True)
        except (serial.SerialException, OSError, ValueError) as error:
            raise RigError(f"power {port}: cannot be opened ({error}); check that the switch is connected") from None
        context.close_at_end(self._close)

    def switch(self, on: bool, address: int | None = None) -> None:
        """Switch the power of the hub and all boards on or off. Raises `RigError` if the address of a single board
        is given.
        """
        if address is not None:
            raise RigError(f"power {self._name}: board 0x{address:02X} cannot be switched alone; switch the whole rig")
        setattr(self._port, self._line, on == self._on_is_high)

    def _close(self) -> None:
        """Leave the power on and close the serial port; a disconnected port is ignored."""
        with contextlib.suppress(serial.SerialException, OSError):
            self.switch(True)
            self._port.close()
