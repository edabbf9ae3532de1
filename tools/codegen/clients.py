"""Write the generated parts of the clients in other languages (protocol/clients) from the construct definitions.

python tools/codegen/clients.py            write them
python tools/codegen/clients.py --check    exit status 1 if a file on disk is stale
"""

import sys

import client_original
import cpp_client
import kaitai_client
import lua_client
import ros2_client
import rust_client
from generated_files import write_or_check


def main() -> int:
    """Write the generated files of all clients, or with --check compare them with the files on disk.

    Returns the exit status: 1 if a compared file is missing or stale.
    """
    files = {cpp_client.FILE: cpp_client.format_text(), rust_client.FILE: rust_client.format_text()}
    for client in (client_original, lua_client, kaitai_client, ros2_client):
        files |= client.format_files()
    return write_or_check(files)


if __name__ == "__main__":
    sys.exit(main())
