"""Fingerprint of the diagnosis, which shows whether two runs can be scored together."""

import hashlib
from pathlib import Path

import taxel.gap


def compute_diagnosis_version() -> str:
    """Compute the fingerprint of the diagnosis, which shows whether two runs used the same program.

    The fingerprint is the first 16 digits of the SHA-256 over the names and contents of the Python sources of
    `taxel.gap`.
    """
    root = Path(taxel.gap.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(f"{path.relative_to(root).as_posix()}\n".encode() + path.read_bytes())
    return digest.hexdigest()[:16]
