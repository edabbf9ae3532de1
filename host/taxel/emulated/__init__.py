"""The emulated skin from Python: the `emulator:` URL, world files with objects, and the contact of skin and objects."""

from taxel.emulated.url import open_emulator, open_original_emulator

__all__ = ["open_emulator", "open_original_emulator"]
