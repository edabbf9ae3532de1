"""Write generated files, or check that they are up to date; the last step of every generator of this folder."""

import sys
from collections.abc import Mapping
from pathlib import Path


def write_or_check(texts: Mapping[Path, str]) -> int:
    """Write each text to its path; with `--check` on the command line only compare.

    Returns the exit status: 1 if a compared file is missing or differs, after one line for each such file.
    """
    status = 0
    for path, text in texts.items():
        if "--check" not in sys.argv[1:]:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        elif not path.exists() or path.read_text() != text:
            print(f"{path.name} is stale: run `make generate`", file=sys.stderr)
            status = 1
    return status
