"""The command `taxel sign`."""

import os
from pathlib import Path
from typing import Annotated

import typer

from taxel.errors import TaxelError
from taxel_tools.signing import PASSPHRASE_VARIABLE, load_development_key, load_private_key, sign_file, sign_images


def sign_command(
    files: Annotated[list[Path], typer.Argument(help=".cyacd, .hex, .bin or a manifest.")],
    key: Annotated[Path | None, typer.Option(help="Private key (.key) of taxel keygen.")] = None,
    development: Annotated[
        bool, typer.Option("--development", help="Sign with the public development key: only for the emulator.")
    ] = False,
    swd: Annotated[bool, typer.Option("--swd", help="The files are for a debug probe (taxel flash --swd).")] = False,
    prompts_passphrase: Annotated[
        bool, typer.Option("--passphrase", help="Request the passphrase of the private key.")
    ] = False,
) -> None:
    """Sign firmware files (Ed25519), so that taxel flash accepts them. Writes a .sig file beside each file.

    The signature covers device, kind, slot, version and code of an image. The passphrase of an encrypted key is also
    read from the environment variable TAXEL_KEY_PASSPHRASE.

    Example: taxel sign board-1.2.0.toml --key release.key
    """
    if (key is None) != development:
        found = "both" if development else "neither"
        raise TaxelError(f"sign: expected one of --key FILE and --development, found {found}")
    if key is None:
        private = load_development_key()
    else:
        passphrase = os.environ.get(PASSPHRASE_VARIABLE)
        if prompts_passphrase:
            passphrase = typer.prompt("Passphrase", hide_input=True, err=True)
        private = load_private_key(key, passphrase)
    written = [sign_file(path, private) for path in files] if swd else sign_images(files, private)
    for path in dict.fromkeys(written):
        print(path)
