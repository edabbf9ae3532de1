"""The compiled libraries that the package brings along."""

from __future__ import annotations

import ctypes
import importlib.resources

from taxel.errors import TaxelError


def load_library(name: str, what: str, error: type[TaxelError]) -> ctypes.CDLL:
    """Load `libNAME.so`. what: what it is called for users. Raises `error`, of one line, if it was not built."""
    path = importlib.resources.files("taxel") / "native" / f"lib{name}.so"
    try:
        return ctypes.CDLL(str(path))
    except OSError as reason:
        raise error(f"{what} is missing from the package; install taxel again (pip install .)") from reason
