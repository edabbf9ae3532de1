"""Search for the sizes of the three test objects that reproduce the thesis's cross-shape distances.

python tools/objects/search_sizes.py --heights 130 130 --restarts 3
                                     three objects of the same height; two to three minutes; prints the seeds
python tools/objects/search_sizes.py                      heights of 120 to 150 mm
python tools/objects/search_sizes.py --heights 90 200     heights within the bounds of the other sizes
python tools/objects/search_sizes.py --evaluate 69 35 130 21 130 36 130
                                     width depth height, radius height, side height, mm

The thesis shows the sizes only in pictures. --band-mm and --palm-share change the assumed contact area, --narrowest
the smallest object that the hand can enclose.
"""

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import asdict, astuple, dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any

from taxel.types import FloatArray

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from clouds import BAND_MM, PALM_SHARE
from objective import (
    IS_CROSS_PAIR,
    TABLES,
    CloudSettings,
    Distances,
    Sizes,
    compute_distances,
    compute_objective,
)
from scipy.optimize import Bounds, differential_evolution, minimize
from thesis_tables import OBJECTS, CloudTable

NARROWEST_MM = 35.0
WIDEST_MM = 110.0
"""Smallest and largest width or diameter that an Allegro hand can enclose, mm. Assumed."""

WIDE_TO_NARROW = 1.15
"""Smallest ratio of the wide to the narrow faces of the box. The thesis distinguishes them, so they differ visibly.
Assumed.
"""

FINAL_POINTS = 600
FINE_POINTS = 300
COARSE_POINTS = 128
POPULATION = 5
"""Number of candidates of a generation divided by the number of sizes."""
GENERATIONS = 36
EVALUATIONS = 120
NEAR_BEST = 1.05
"""Ratio to the best objective up to which results count as equally good."""
LARGE_RATIO = 1.25
"""Ratio to the thesis's distance above which a pair is marked."""
HEADINGS = "".join(f"   {name:>6} thesis ratio" for name in ("mean", "RMS", "max"))


@dataclass(frozen=True)
class SearchSpace:
    """Vectors of seven sizes, or of eight with the leg of the triangle, and their bounds, mm."""

    heights: tuple[float, float]
    isosceles: bool
    narrowest: float = NARROWEST_MM

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the lower and the upper bounds of the vector of sizes, f64[7] or f64[8] each, mm.

        The sizes are in the order of `Sizes`: width, depth and height of the box, radius and height of the cylinder,
        side and height of the triangular prism, and its leg if `isosceles`.
        """
        low, high = self.narrowest, WIDEST_MM
        rows = [(low, high), (low, high), self.heights, (low / 2, high / 2), self.heights, (low, high), self.heights]
        table = np.array([*rows, (low, high)] if self.isosceles else rows)
        return table[:, 0], table[:, 1]

    def sizes(self, vector: FloatArray) -> tuple[Sizes, float]:
        """Return the sizes within the bounds that are nearest to a vector, and a penalty.

        The penalty grows with the distance from the bounds, for a box that is nearly square, and for a triangle that is
        not the smallest object.
        """
        lowest, highest = self.bounds()
        clipped = np.clip(vector, lowest, highest)
        values = [float(v) for v in clipped]
        # A leg above half the base is necessary for a triangle; 0.6 excludes nearly flat ones.
        leg = max(values[7], 0.6 * values[5]) if self.isosceles else values[5]
        sizes = Sizes(*[*values[:7], leg])
        rectangular, cylindrical, triangular = sizes.circumferences()
        too_square = max(0.0, WIDE_TO_NARROW * sizes.depth - sizes.width)
        too_large = max(0.0, triangular - min(rectangular, cylindrical))
        penalty = float(np.sum((vector - clipped) ** 2)) + too_square**2 + too_large**2
        return sizes, penalty / 100.0


def search(space: SearchSpace, settings: CloudSettings, log: Callable[[str], None]) -> Sizes:
    """Search for the object sizes that reproduce the distances of the thesis best, for one seed.

    A differential evolution with few points per cloud is followed by a simplex descent with more points. log: called
    with one line.
    """

    def penalised_objective(vector: FloatArray, cloud_settings: CloudSettings) -> float:
        """Return the objective of the sizes that an optimiser's vector represents, plus the penalty of the vector."""
        sizes, penalty = space.sizes(vector)
        return compute_objective(sizes, cloud_settings) + penalty

    coarse_settings = CloudSettings(COARSE_POINTS, settings.seed, settings.band_mm, settings.palm_share)
    coarse_objective: Any = partial(penalised_objective, cloud_settings=coarse_settings)
    fine_objective: Any = partial(penalised_objective, cloud_settings=settings)
    generator = np.random.default_rng(settings.seed)
    limits = Bounds(*space.bounds())
    coarse = differential_evolution(
        coarse_objective, limits, popsize=POPULATION, maxiter=GENERATIONS, tol=1e-3, polish=False, rng=generator
    )
    simplex: Any = {"maxfev": EVALUATIONS, "xatol": 0.2, "fatol": 1e-3}
    fine = minimize(fine_objective, coarse.x, method="Nelder-Mead", options=simplex)
    log(f"seed {settings.seed}: {coarse.fun:.3f} with {COARSE_POINTS} points, {fine.fun:.3f} with {settings.points}")
    return space.sizes(fine.x)[0]


def format_sizes(sizes: Sizes) -> str:
    """Return the object sizes in one line, in the order of the option --evaluate."""
    s = sizes
    leg = "" if s.leg == s.side else f" (legs {s.leg:.0f})"
    return (
        f"box {s.width:.0f} x {s.depth:.0f} x {s.height:.0f}, "
        f"cylinder radius {s.radius:.0f} x {s.cylinder_height:.0f}, "
        f"triangle side {s.side:.0f}{leg} x {s.triangle_height:.0f} mm"
    )


def format_table(distances: Distances, table: CloudTable) -> list[str]:
    """Return the text table of modelled distances and those of the thesis, one line per pair of cloud and object.

    A ratio above LARGE_RATIO is marked.
    """
    lines = [f"{table.source} clouds, mm".ljust(24) + HEADINGS]
    for i, cloud in enumerate(OBJECTS):
        for j, model in enumerate(OBJECTS):
            columns = ""
            for a, b in ((distances.mean, table.mean), (distances.rms, table.rms), (distances.largest, table.largest)):
                columns += f"   {a[i, j]:6.2f} {b[i, j]:6.2f} {a[i, j] / b[i, j]:5.2f}"
            worst = np.exp(
                max(abs(np.log(distances.mean / table.mean)[i, j]), abs(np.log(distances.rms / table.rms)[i, j]))
            )
            mark = "  large ratio" if worst > LARGE_RATIO else ""
            own = "" if IS_CROSS_PAIR[i, j] else " (own)"
            lines.append(f"{cloud[:6]} to {model[:6]}{own}".ljust(24) + columns + mark)
    return lines


def build_report(sizes: Sizes, settings: CloudSettings) -> dict[str, object]:
    """Return the sizes, the objective and all distances as JSON values."""
    results: dict[str, object] = {"sizes_mm": asdict(sizes), "objective": compute_objective(sizes, settings)}
    for distances, (table, _) in zip(compute_distances(sizes, settings), TABLES, strict=True):
        results[table.source] = {
            name: getattr(distances, name).round(3).tolist() for name in ("mean", "rms", "largest")
        }
    return results


def format_ranges(results: list[tuple[float, Sizes]]) -> list[str]:
    """Return the lines with the range of each size among the results whose objective is close to the best one.

    results: (objective, sizes) of each seed, in ascending order of the objective.
    """
    near = [astuple(sizes) for value, sizes in results if value <= NEAR_BEST * results[0][0]]
    names = [f.name for f in fields(Sizes)]
    count = f"{len(near)} of {len(results)} seeds"
    lines = [f"{count} end within {NEAR_BEST - 1:.0%} of the best objective; their sizes, mm:"]
    for name, values in zip(names, zip(*near, strict=True), strict=True):
        lines.append(f"  {name:16} {min(values):6.1f} to {max(values):6.1f}")
    return lines


def parse_arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description="Search the sizes of the three test objects.")
    parser.add_argument("--seed", type=int, default=1, help="first seed; each restart adds one")
    parser.add_argument("--restarts", type=int, default=5, help="searches, each with its own seed and clouds")
    parser.add_argument("--heights", type=float, nargs=2, default=(120.0, 150.0), metavar=("LOW", "HIGH"))
    parser.add_argument("--narrowest", type=float, default=NARROWEST_MM, help="smallest width or diameter, mm")
    parser.add_argument("--isosceles", action="store_true", help="let two sides of the triangle differ from the base")
    parser.add_argument("--evaluate", type=float, nargs=7, metavar=("W", "D", "H", "R", "HC", "A", "HT"))
    parser.add_argument("--band-mm", type=float, default=BAND_MM, help="height band of a side grasp")
    parser.add_argument("--palm-share", type=float, default=PALM_SHARE, help="top-grasp points on the top face")
    parser.add_argument("--json", action="store_true", help="print one JSON document instead of text")
    return parser.parse_args()


def main() -> int:
    """Search for the best object sizes and print them, or print the objective of given sizes."""
    args = parse_arguments()
    final = CloudSettings(FINAL_POINTS, 0, args.band_mm, args.palm_share)
    log: Callable[[str], None] = (lambda line: print(line, file=sys.stderr)) if args.json else print
    ranges: list[str] = []
    if args.evaluate:
        sizes = Sizes(*[*args.evaluate, args.evaluate[5]])  # the triangle is equilateral: its leg is its side
    else:
        log(f"seeds {args.seed} to {args.seed + args.restarts - 1}")
        space = SearchSpace((args.heights[0], args.heights[1]), args.isosceles, args.narrowest)
        candidates = []
        for seed in range(args.seed, args.seed + args.restarts):
            settings = CloudSettings(FINE_POINTS, seed, args.band_mm, args.palm_share)
            candidate = search(space, settings, log)
            candidates.append((compute_objective(candidate, final), candidate))
            log(f"  {candidates[-1][0]:.3f} with {FINAL_POINTS} points: {format_sizes(candidate)}")
        candidates.sort(key=lambda pair: pair[0])
        sizes, ranges = candidates[0][1].rounded(), format_ranges(candidates)
    results = build_report(sizes, final)
    if args.json:
        print(json.dumps({"seed": args.seed, "restarts": args.restarts, **results, "spread": ranges}, indent=2))
        return 0
    print(
        "\n".join([*ranges, f"{format_sizes(sizes)}\nobjective {results['objective']:.3f} with {FINAL_POINTS} points"])
    )
    for distances, (table, _) in zip(compute_distances(sizes, final), TABLES, strict=True):
        print("\n" + "\n".join(format_table(distances, table)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
