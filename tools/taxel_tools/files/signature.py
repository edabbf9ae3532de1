"""Signatures of firmware files: Ed25519 (RFC 8032) over the image, in a text file beside it.

A signature file has the name of the signed file with the suffix `.sig`, and covers the content of the image with its
header: device, kind, slot, version and code. The same signature therefore belongs to the `.cyacd`, `.hex` and `.bin`
file of one image. A file for a debug probe (`--swd`), which is no image, is signed byte by byte.
"""

import re
import tomllib
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Final

from taxel.optional import optional_import
from taxel_tools.errors import FirmwareFileError, SignatureError

SIGNATURE_SUFFIX: Final = ".sig"
SIGNATURE_VERSION: Final = 1
SIGNATURE_FILE_MAX: Final = 4096
"""Size limit of a signature file or a public key file in bytes; they have about 300."""
PUBLIC_KEY_BYTES: Final = 32
SIGNATURE_BYTES: Final = 64
PURPOSE: Final = "signatures of firmware"

_HEXADECIMAL: Final = re.compile(r"[0-9a-f]*")


class Content(Enum):
    """What a signature covers: an image or a whole file.

    The name enters the signed bytes, so that a signature of one content is not valid for the other.
    """

    IMAGE = "image"
    FILE = "file"


@dataclass(frozen=True)
class Signature:
    """Content of a signature file. public_key: 32 bytes. signature: 64 bytes."""

    content: Content
    public_key: bytes
    signature: bytes


def build_message(content: Content, data: bytes) -> bytes:
    """Build the bytes that are signed: a line that names purpose and version, then the data."""
    return f"taxel firmware {content.value} {SIGNATURE_VERSION}\n".encode() + data


def get_signature_path(path: Path) -> Path:
    """Return the path of the signature file that belongs to a firmware file."""
    return path.with_suffix(SIGNATURE_SUFFIX)


def format_signature(signature: Signature) -> str:
    """Format the text of a signature file."""
    return (
        f"# Ed25519 signature of a taxel firmware {signature.content.value}.\n"
        f"taxel_signature = {SIGNATURE_VERSION}\n"
        f'content = "{signature.content.value}"\n'
        f'public_key = "{signature.public_key.hex()}"\n'
        f'signature = "{signature.signature.hex()}"\n'
    )


def read_signature(path: Path) -> Signature:
    """Read the signature file beside a firmware file. Raises `SignatureError` if there is none or it is invalid."""
    file = get_signature_path(path)
    if not file.is_file():
        raise SignatureError(str(path), f"a signature file {file.name} beside it", "none")
    try:
        document = tomllib.loads(_read_small_file(file).decode())
        content = Content(document["content"])
        key, signature = (_parse_hex(document[name]) for name in ("public_key", "signature"))
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise SignatureError(str(file), "a signature file", str(error).splitlines()[0] or "an invalid value") from None
    if document.get("taxel_signature") != SIGNATURE_VERSION:
        raise SignatureError(str(file), f"version {SIGNATURE_VERSION}", repr(document.get("taxel_signature")))
    if len(key) != PUBLIC_KEY_BYTES or len(signature) != SIGNATURE_BYTES:
        found = f"{len(key)} and {len(signature)} bytes"
        raise SignatureError(
            str(file), f"a key of {PUBLIC_KEY_BYTES} and a signature of {SIGNATURE_BYTES} bytes", found
        )
    return Signature(content, key, signature)


def read_public_key(path: Path) -> bytes:
    """Read a public key file (.pub), 32 bytes. Raises `FirmwareFileError`, OSError."""
    try:
        document = tomllib.loads(_read_small_file(path).decode())
        key = _parse_hex(document["public_key"])
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        reason = str(error).splitlines()[0] or "an invalid value"
        raise FirmwareFileError(
            str(path), "file", "a public key of taxel keygen", reason, "pass the .pub file"
        ) from None
    if len(key) != PUBLIC_KEY_BYTES:
        found = f"{len(key)} bytes"
        raise FirmwareFileError(str(path), "public_key", f"{PUBLIC_KEY_BYTES} bytes", found, "pass the .pub file")
    return key


def format_public_key(key: bytes, name: str) -> str:
    """Format the text of a public key file. key: 32 bytes; name: name of the signer."""
    return f'# Public key of the taxel firmware releases of "{name}".\npublic_key = "{key.hex()}"\n'


def is_valid(signature: Signature, message: bytes) -> bool:
    """Return whether the signature of the message is correct for its public key.

    Raises `MissingPackageError` without the package `cryptography`.
    """
    with optional_import("cryptography", PURPOSE):
        from cryptography.exceptions import InvalidSignature
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    try:
        Ed25519PublicKey.from_public_bytes(signature.public_key).verify(signature.signature, message)
    except (InvalidSignature, ValueError):
        return False
    return True


def _parse_hex(text: str) -> bytes:
    """Decode a string of lower-case hexadecimal digits.

    Raises ValueError for other characters, TypeError if `text` is no string.
    """
    if not _HEXADECIMAL.fullmatch(text):
        raise ValueError("not hexadecimal")
    return bytes.fromhex(text)


def _read_small_file(path: Path) -> bytes:
    """Read a file of at most `SIGNATURE_FILE_MAX` bytes. Raises ValueError if it is longer."""
    with path.open("rb") as file:
        data = file.read(SIGNATURE_FILE_MAX + 1)
    if len(data) > SIGNATURE_FILE_MAX:
        raise ValueError(f"more than {SIGNATURE_FILE_MAX} bytes")
    return data
