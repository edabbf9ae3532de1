"""Opening of an I2C adapter of this computer through smbus2."""

from __future__ import annotations

from typing import TYPE_CHECKING

from taxel.link.errors import PortMissingError
from taxel.link.port_lock import lock_device
from taxel.optional import optional_import

if TYPE_CHECKING:
    import smbus2


def open_i2c(device: str) -> smbus2.SMBus:
    """Open the I2C adapter `/dev/i2c-N` for this program alone. The caller closes the adapter.

    Raises `PortBusyError` if another program has locked the adapter, a one-line `PortMissingError` with a remedy if it
    cannot be opened, and `MissingPackageError` without smbus2.
    """
    with optional_import("smbus2", f"the I2C adapter {device}"):
        import smbus2
    try:
        bus = smbus2.SMBus(device)
    except OSError as error:
        raise PortMissingError(
            device,
            f"cannot be opened ({error.strerror}); check that the adapter is connected, that its driver is loaded "
            "(modprobe i2c-dev), and that your user is in the group i2c",
        ) from None
    assert bus.fd is not None
    try:
        lock_device(bus.fd, device)
    except PortMissingError:
        bus.close()
        raise
    return bus
