"""The command `taxel keygen`."""

import os
from pathlib import Path
from typing import Annotated

import typer

from taxel.errors import TaxelError
from taxel.output import write_whole
from taxel_tools.files.signature import format_public_key
from taxel_tools.signing import PASSPHRASE_VARIABLE, generate_key

PRIVATE_MODE = 0o600
PUBLIC_MODE = 0o644


def keygen_command(
    name: Annotated[Path, typer.Argument(help="Path without suffix: NAME.key and NAME.pub are written.")],
    passphrase: Annotated[bool, typer.Option("--passphrase", help="Request a passphrase of the private key.")] = False,
) -> None:
    """Generate a key pair for signatures of firmware (Ed25519): NAME.key is secret, NAME.pub is for every user.

    The private key is encrypted with --passphrase, or with the passphrase in the environment variable
    TAXEL_KEY_PASSPHRASE. Existing files are never replaced.

    Example: taxel keygen release --passphrase
    """
    text = os.environ.get(PASSPHRASE_VARIABLE)
    if passphrase:
        text = typer.prompt("Passphrase", hide_input=True, confirmation_prompt=True, err=True)
    private, public = generate_key(text)
    files = ((name.with_name(name.name + ".key"), PRIVATE_MODE), (name.with_name(name.name + ".pub"), PUBLIC_MODE))
    for path, _ in files:
        if path.exists():
            raise TaxelError(f"{path}: exists already; a key is never replaced: choose another name")
    contents = (private, format_public_key(public, name.name).encode())
    for (path, mode), content in zip(files, contents, strict=True):
        write_whole(path, content, overwrite=False, mode=mode)
    print(f"{files[0][0]}: private key, {'encrypted' if text else 'NOT encrypted'}; keep it secret, and keep a copy")
    print(f"{files[1][0]}: public key; users pass it with taxel flash --trust, or copy it to their key folder")
