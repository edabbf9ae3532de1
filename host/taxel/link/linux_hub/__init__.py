"""A skin without a hub: this process executes the hub's firmware on an I2C adapter of the computer."""

from taxel.link.linux_hub.adapter import open_adapter
from taxel.link.linux_hub.link import LinuxHubLink
from taxel.link.linux_hub.url import is_i2c_url, open_linux_hub, parse_i2c_url

__all__ = ["LinuxHubLink", "is_i2c_url", "open_adapter", "open_linux_hub", "parse_i2c_url"]
