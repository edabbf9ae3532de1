"""Write the taxel centres that the original programs use into the package: host/taxel/hand/original/coded_centres.csv.

    python tools/hand/original_coded_centres.py [--check]

The original host and the original contact plug-in contain these centres as numbers. Inputs: `coded_*` of
tools/hand/original/taxels_*.csv. Kinds without such numbers are left out.
"""

import sys
from pathlib import Path
from typing import Final

from original_figures import FIGURES, read_coded_centres
from written_files import write_or_compare

TARGET: Final = Path(__file__).parents[2] / "host/taxel/hand/original/coded_centres.csv"


def format_table() -> str:
    """Return the text of the table: board kind, taxel index, and centre in the bracket's frame in metres."""
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
    """Write the table, or with --check compare it; the exit status is 1 if it differs."""
    return write_or_compare({TARGET: format_table()}, __doc__.splitlines()[0])


if __name__ == "__main__":
    sys.exit(main())
