"""Commands that operate sensor boards: scan, provision, flash and bench, over the hub's UART or an I2C adapter."""
