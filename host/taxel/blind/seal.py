"""Commitments: the hidden causes are fixed before the data are published and cannot be changed afterwards."""

import hashlib
import json
from typing import Any

from taxel.errors import TaxelError


class SealBrokenError(TaxelError):
    """A key that does not match its commitment."""

    def __init__(self, world: int) -> None:
        super().__init__(world)

    def __str__(self) -> str:
        return (
            f"world {self.args[0]}: the key does not match its commitment, the folder was modified; "
            "run the check again in another folder"
        )


def canonical(key: dict[str, Any]) -> bytes:
    """Canonical JSON text of a key."""
    return json.dumps(key, sort_keys=True, separators=(",", ":")).encode()


def commitment(key: dict[str, Any]) -> str:
    """SHA-256 of a key, hexadecimal. The key contains a salt of 256 bits, so its content cannot be guessed."""
    return hashlib.sha256(canonical(key)).hexdigest()


def verify_commitment(world: int, key: dict[str, Any], committed: str) -> None:
    """Raise SealBrokenError if the key does not match the commitment."""
    if commitment(key) != committed:
        raise SealBrokenError(world)
