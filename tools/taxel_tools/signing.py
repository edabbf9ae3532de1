"""Private keys and signatures of firmware files."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from taxel.errors import TaxelError
from taxel.optional import optional_import
from taxel.output import write_whole
from taxel_tools.files.load import load_firmware
from taxel_tools.files.signature import (
    PURPOSE,
    Content,
    Signature,
    build_message,
    format_signature,
    get_signature_path,
)
from taxel_tools.trust import DEVELOPMENT_SEED

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

PASSPHRASE_VARIABLE: Final = "TAXEL_KEY_PASSPHRASE"
KEY_FILE_MAX: Final = 1 << 14
"""Size limit of a private key file in bytes; an encrypted key has about 300."""


def generate_key(passphrase: str | None) -> tuple[bytes, bytes]:
    """Generate a key pair: the private key as PEM (PKCS 8), encrypted if there is a passphrase; the public key, 32
    bytes.
    """
    with optional_import("cryptography", PURPOSE):
        from cryptography.hazmat.primitives import serialization
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    key = Ed25519PrivateKey.generate()
    encryption: serialization.KeySerializationEncryption = (
        serialization.BestAvailableEncryption(passphrase.encode()) if passphrase else serialization.NoEncryption()
    )
    private = key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, encryption)
    return private, key.public_key().public_bytes_raw()


def load_development_key() -> "Ed25519PrivateKey":
    """Return the development key, with which everyone can sign; only emulated devices accept its signatures."""
    with optional_import("cryptography", PURPOSE):
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    return Ed25519PrivateKey.from_private_bytes(DEVELOPMENT_SEED)


def load_private_key(path: Path, passphrase: str | None) -> "Ed25519PrivateKey":
    """Read a private key of `taxel keygen`.

    Raises `TaxelError` for a file of another kind or a wrong passphrase, OSError.
    """
    with optional_import("cryptography", PURPOSE):
        from cryptography.hazmat.primitives import serialization
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    with path.open("rb") as file:
        data = file.read(KEY_FILE_MAX)
    try:
        key = serialization.load_pem_private_key(data, passphrase.encode() if passphrase else None)
    except TypeError as error:  # a passphrase is missing, or given for a key that is not encrypted
        raise TaxelError(f"{path}: {error}; set {PASSPHRASE_VARIABLE} accordingly") from None
    except ValueError:
        raise TaxelError(
            f"{path}: expected a private key of taxel keygen and its passphrase, found other data; check both"
        ) from None
    if not isinstance(key, Ed25519PrivateKey):
        raise TaxelError(f"{path}: expected an Ed25519 key, found another kind; generate one with taxel keygen")
    return key


def sign_images(paths: Sequence[Path], key: "Ed25519PrivateKey") -> list[Path]:
    """Sign every image in the firmware files and manifests, each in a file beside it; returns the signature files.

    Raises `FirmwareFileError` for a damaged firmware file, OSError.
    """
    written = []
    for path in paths:
        for image in load_firmware([path]).images:
            written.append(_write(Path(image.source), Content.IMAGE, image.data, key))
    return list(dict.fromkeys(written))


def sign_file(path: Path, key: "Ed25519PrivateKey") -> Path:
    """Sign the bytes of a file for a debug probe; returns the signature file. Raises OSError."""
    return _write(path, Content.FILE, path.read_bytes(), key)


def _write(path: Path, content: Content, data: bytes, key: "Ed25519PrivateKey") -> Path:
    """Write the signature file of `data` beside the file `path`, in one step, and return the path of the signature
    file.
    """
    public = key.public_key().public_bytes_raw()
    signature = Signature(content, public, key.sign(build_message(content, data)))
    file = get_signature_path(path)
    write_whole(file, format_signature(signature))
    return file
