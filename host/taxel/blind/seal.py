"""Commitments: the hidden causes are fixed before the data are published and cannot be changed afterwards."""

import hashlib
import json
from typing import Any

from taxel.errors import TaxelError


class SealBrokenError(TaxelError):
    """The key of a world (its hidden causes) does not match the commitment published before the diagnosis."""

    def __init__(self, world: int) -> None:
        """Create the error of a world whose key does not match its commitment. world: number of the world."""
        super().__init__(world)

    def _format_message(self) -> str:
        """Format the error as one line with the number of the world and the remedy."""
        return (
            f"world {self.args[0]}: the key does not match its commitment, the folder was modified; "
            "run the check again in another folder"
        )


def canonical(key: dict[str, Any]) -> bytes:
    """Return the canonical JSON text of a world's key (its hidden causes), so that equal keys have equal bytes."""
    return json.dumps(key, sort_keys=True, separators=(",", ":")).encode()


def commitment(key: dict[str, Any]) -> str:
    """Compute the SHA-256 of a world's key, hexadecimal, which fixes the hidden causes before the diagnosis.

    The key contains a salt of 256 bits, so that its content cannot be guessed from the hash.
    """
    return hashlib.sha256(canonical(key)).hexdigest()


def verify_commitment(world: int, key: dict[str, Any], committed: str) -> None:
    """Raise SealBrokenError if the key of a world does not match its commitment. committed: SHA-256, hexadecimal."""
    if commitment(key) != committed:
        raise SealBrokenError(world)
