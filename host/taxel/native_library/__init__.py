"""Loads the compiled libraries of the package and reads what they print on standard error."""

from taxel.native_library.loading import check_structure, load_library
from taxel.native_library.stderr_file import emulator_message, redirected_stderr

__all__ = ["check_structure", "emulator_message", "load_library", "redirected_stderr"]
