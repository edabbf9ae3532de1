"""Which signatures of firmware are accepted: trusted public keys, and the development key for the emulator."""

import hashlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from taxel.optional import optional_import
from taxel_tools.errors import SignatureError
from taxel_tools.files.firmware import Firmware
from taxel_tools.files.signature import (
    PURPOSE,
    Content,
    Signature,
    build_message,
    get_signature_path,
    is_valid,
    read_public_key,
    read_signature,
)

DEVELOPMENT_SEED: Final = hashlib.sha256(b"taxel development key: everyone can sign with it").digest()
"""Private key of the builds of `make firmware`. It is public, so its signature proves nothing about the origin of an
image; only emulated devices accept it."""

EMULATOR_PREFIX: Final = "emulator:"
PUBLIC_KEY_SUFFIX: Final = ".pub"

TrustedKeys = Mapping[bytes, str]
"""Names of the trusted public keys (32 bytes each)."""


def get_key_folder() -> Path:
    """Return the folder whose .pub files are trusted: `taxel/firmware-keys` in the configuration folder of the user."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "taxel" / "firmware-keys"


def read_trusted_keys(files: Sequence[Path]) -> dict[bytes, str]:
    """Read the public keys of `files` and of the key folder; return the names of their files by key.

    Raises `FirmwareFileError` for an invalid key file, OSError.
    """
    folder = get_key_folder()
    stored = sorted(folder.glob(f"*{PUBLIC_KEY_SUFFIX}")) if folder.is_dir() else []
    return {read_public_key(path): path.name for path in (*stored, *files)}


def get_development_public_key() -> bytes:
    """Return the public key of the development key. Raises `MissingPackageError` without the package `cryptography`."""
    with optional_import("cryptography", PURPOSE):
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    return Ed25519PrivateKey.from_private_bytes(DEVELOPMENT_SEED).public_key().public_bytes_raw()


def check_firmware(firmware: Firmware, keys: TrustedKeys, is_emulated: bool) -> str:
    """Check the signature of every image of a firmware; returns the name of the key of the first image.

    is_emulated: the device is emulated, so that the development key is accepted. Raises `SignatureError` for a missing,
    wrong or untrusted signature, `MissingPackageError` without the package `cryptography`.
    """
    names = [
        _check(Path(image.source), Content.IMAGE, image.data, keys, is_emulated=is_emulated)
        for image in firmware.images
    ]
    return names[0]


def check_file(path: Path, data: bytes, keys: TrustedKeys) -> str:
    """Check the signature of a file for a debug probe; returns the name of its key. Raises as `check_firmware`."""
    return _check(path, Content.FILE, data, keys, is_emulated=False)


def _check(path: Path, content: Content, data: bytes, keys: TrustedKeys, *, is_emulated: bool) -> str:
    """Check the signature file beside a file; return the name of the key. Raises `SignatureError`.

    data: signed content of the file.
    """
    signature = read_signature(path)
    file = str(get_signature_path(path))
    if signature.content is not content:
        raise SignatureError(file, f"a signature of an {content.value}", f"one of a {signature.content.value}")
    if not is_valid(signature, build_message(content, data)):
        raise SignatureError(file, f"a signature of {path.name}", "a signature of other bytes, or a damaged one")
    return _name_key(file, signature, keys, is_emulated)


def _name_key(file: str, signature: Signature, keys: TrustedKeys, is_emulated: bool) -> str:
    """Return the name of the key of a valid signature. Raises `SignatureError` if the key is not trusted."""
    if signature.public_key in keys:
        return keys[signature.public_key]
    if signature.public_key != get_development_public_key():
        found = f"the key {signature.public_key.hex()[:16]}..."
        trusted = f"a trusted key ({', '.join(sorted(keys.values())) or 'none is configured'})"
        remedy = f"verify the origin of the key, then add it with --trust FILE.pub or copy it to {get_key_folder()}"
        raise SignatureError(file, trusted, found, remedy)
    if is_emulated:
        return "development key"
    remedy = "sign the image with your own key (taxel sign), or write it with --unsigned"
    raise SignatureError(file, "a trusted key", "the development key, with which everyone can sign", remedy)
