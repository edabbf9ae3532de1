"""Write the files of a program of this folder, or compare them; with the option --check."""

import argparse
from collections.abc import Mapping
from pathlib import Path


def write_or_compare(texts: Mapping[Path, str], description: str) -> int:
    """Write each text whose file differs, or with `--check` on the command line only compare.

    Prints the names of the files that differ. description: description of the program, for its help. Returns the exit
    status: 1 if a compared file differs.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--check", action="store_true", help="write nothing; exit status 1 if a file is outdated")
    is_check = parser.parse_args().check
    outdated = [path for path, text in texts.items() if not path.exists() or path.read_text() != text]
    for path in outdated:
        if not is_check:
            path.write_text(texts[path])
    if outdated:
        print(f"{'outdated' if is_check else 'written'}: {', '.join(path.name for path in outdated)}")
    return 1 if is_check and outdated else 0
