"""Firmware files: cyacd, Intel HEX, raw images, and manifests that name several files."""

from taxel_tools.files.firmware import Firmware, FirmwareImage, format_slot
from taxel_tools.files.load import load_firmware

__all__ = ["Firmware", "FirmwareImage", "format_slot", "load_firmware"]
