"""Which diagnosis answered: what tells that two runs may be scored as one."""

from __future__ import annotations

import hashlib
from pathlib import Path

import taxel.gap


def diagnosis_version() -> str:
    """Of the diagnosis as it is installed: the first 16 digits of the SHA-256 over its sources and their names."""
    root = Path(taxel.gap.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(f"{path.relative_to(root).as_posix()}\n".encode() + path.read_bytes())
    return digest.hexdigest()[:16]
