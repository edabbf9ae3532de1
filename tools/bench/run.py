"""Run every benchmark and print one table.

python tools/bench/run.py [--json]
"""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bench_decoder
import bench_emulator
from figures import Figure
from rich.console import Console
from rich.table import Table


def table_of(figures: list[Figure]) -> Table:
    """One row a figure."""
    table = Table(title="benchmarks: medians of ratios, measured in one run")
    for heading in ("figure", "ratio", "at least", "reference", "detail"):
        table.add_column(heading, justify="right" if heading in {"ratio", "at least"} else "left")
    for figure in figures:
        colour = "green" if figure.ratio >= figure.target else "red"
        table.add_row(
            figure.name,
            f"[{colour}]{figure.ratio:.1f}[/]",
            f"{figure.target:g}",
            figure.reference,
            figure.detail,
        )
    return table


def main() -> int:
    """Exit status 1 if a figure misses its target."""
    figures = bench_emulator.measure() + bench_decoder.measure()
    if "--json" in sys.argv[1:]:
        print(json.dumps([figure.__dict__ for figure in figures], indent=2))
    else:
        Console(width=150).print(table_of(figures))
    return 0 if all(figure.ratio >= figure.target for figure in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
