"""Write the taxel centres that the original programs use into the package: host/taxel/hand/original/coded_centres.csv.

    python tools/hand/original_coded_centres.py [--check]

The original host and the original contact plug-in contain these centres as numbers. Inputs: `coded_*` of
tools/hand/original/taxels_*.csv. Kinds without such numbers are left out.
"""

import argparse
import sys
from pathlib import Path
from typing import Final

from original_figures import FIGURES, read_coded_centres

TARGET: Final = Path(__file__).parents[2] / "host/taxel/hand/original/coded_centres.csv"


def format_table() -> str:
    """Text of the table: kind, taxel index and centre in the bracket's frame, metres."""
    lines = ["kind,index,x_m,y_m,z_m"]
    for path in sorted(FIGURES.glob("taxels_*.csv")):
        kind = path.stem.removeprefix("taxels_")
        centres = read_coded_centres(kind)
        if centres is not None:
            lines += [
                f"{kind},{index}," + ",".join(f"{value:.6f}" for value in row)
                for index, row in enumerate(centres.tolist())
            ]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Write the table, or compare it with --check."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; exit status 1 if the file is outdated")
    is_check = parser.parse_args().check
    text = format_table()
    if TARGET.exists() and TARGET.read_text() == text:
        return 0
    if not is_check:
        TARGET.write_text(text)
    print(f"{'outdated' if is_check else 'written'}: {TARGET.name}")
    return 1 if is_check else 0


if __name__ == "__main__":
    sys.exit(main())
