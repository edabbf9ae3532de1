"""The emulated skin from Python: the `emulator:` URL, worlds with objects, and how their contact pushes back."""

from taxel.emulated.url import open_emulator

__all__ = ["open_emulator"]
