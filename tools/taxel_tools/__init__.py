"""Scan, provision and flash sensor boards: over the hub's UART or an I2C adapter, all boards at once."""
