"""Commitments: what a world hides is fixed before its data are published, and cannot be changed afterwards."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from taxel.errors import TaxelError


class SealBrokenError(TaxelError):
    """A key that does not fit what was committed to."""

    def __init__(self, world: int) -> None:
        super().__init__(world)

    def __str__(self) -> str:
        return f"world {self.args[0]}: key does not fit its commitment; the folder was changed: run the check anew"


def canonical(key: dict[str, Any]) -> bytes:
    """One text for one key."""
    return json.dumps(key, sort_keys=True, separators=(",", ":")).encode()


def commitment(key: dict[str, Any]) -> str:
    """SHA-256 of a key, hex. The key holds a salt of 256 bits: guesses at the rest lead nowhere."""
    return hashlib.sha256(canonical(key)).hexdigest()


def check(world: int, key: dict[str, Any], committed: str) -> None:
    """Raises SealBrokenError if the key is another one."""
    if commitment(key) != committed:
        raise SealBrokenError(world)
