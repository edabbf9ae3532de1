"""An I2C adapter of Linux, through smbus2."""

from __future__ import annotations

import smbus2

from taxel.link.errors import PortMissingError


def open_i2c(device: str) -> smbus2.SMBus:
    """Open `/dev/i2c-N`; the caller closes it. Raises `PortMissingError` with one line that says what to do."""
    try:
        return smbus2.SMBus(device)
    except OSError as error:
        raise PortMissingError(
            device,
            f"cannot be opened ({error.strerror}); is the adapter there, its driver loaded (modprobe i2c-dev), and may "
            "you open it (group i2c)?",
        ) from None
