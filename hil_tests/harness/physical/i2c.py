"""An I2C adapter of Linux, through smbus2."""

from __future__ import annotations

import smbus2

from hil_tests.harness.errors import RigError


def open_i2c(bus: str) -> smbus2.SMBus:
    """`/dev/i2c-N`. Raises `RigError` if it cannot be opened."""
    try:
        return smbus2.SMBus(bus)
    except OSError as error:
        raise RigError(
            f"I2C bus {bus}: {error.strerror}; is the adapter there, its driver loaded (modprobe i2c-dev), and may you "
            "open it (group i2c)?"
        ) from None
