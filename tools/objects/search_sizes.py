"""Which sizes of the three test objects reproduce the thesis's cross-shape distances?

python tools/objects/search_sizes.py --heights 130 130 --restarts 3
                                     three objects of one height; two to three minutes, seeds printed
python tools/objects/search_sizes.py                      heights of 120 to 150 mm
python tools/objects/search_sizes.py --heights 90 200     heights as free as the other sizes
python tools/objects/search_sizes.py --evaluate 69 35 130 21 130 36 130
                                     width depth height, radius height, side height, mm

The thesis gives the sizes only in pictures. --band-mm and --palm-share change what is
assumed of the touched area, --narrowest what the hand can wrap.
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
from objective import CROSS, TABLES, Distances, Setting, Sizes, distances, objective
from scipy.optimize import Bounds, differential_evolution, minimize
from thesis_tables import OBJECTS, CloudTable

NARROWEST_MM = 35.0
WIDEST_MM = 110.0
"""Widths and diameters an Allegro hand can wrap. Assumed."""

WIDE_TO_NARROW = 1.15
"""The thesis speaks of wide and narrow faces, so a wide one is at least this much wider."""

FINAL_POINTS = 600
FINE_POINTS = 300
COARSE_POINTS = 128
POPULATION = 5
"""Candidates a generation, times the number of sizes."""
GENERATIONS = 36
EVALUATIONS = 120
NEAR_BEST = 1.05
FAR_OFF = 1.25
HEADINGS = "".join(f"   {name:>6} thesis ratio" for name in ("mean", "RMS", "max"))


@dataclass(frozen=True)
class Space:
    """The sizes searched: a vector of seven numbers, or eight with the triangle's leg, and its bounds, mm."""

    heights: tuple[float, float]
    isosceles: bool
    narrowest: float = NARROWEST_MM

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest vector."""
        low, high = self.narrowest, WIDEST_MM
        rows = [(low, high), (low, high), self.heights, (low / 2, high / 2), self.heights, (low, high), self.heights]
        table = np.array([*rows, (low, high)] if self.isosceles else rows)
        return table[:, 0], table[:, 1]

    def sizes(self, vector: FloatArray) -> tuple[Sizes, float]:
        """The nearest sizes within bounds, and a penalty for what was out of them or breaks the text."""
        lowest, highest = self.bounds()
        inside = np.clip(vector, lowest, highest)
        values = [float(v) for v in inside]
        leg = max(values[7], 0.6 * values[5]) if self.isosceles else values[5]
        sizes = Sizes(*[*values[:7], leg])
        rectangular, cylindrical, triangular = sizes.circumferences()
        narrow = max(0.0, WIDE_TO_NARROW * sizes.depth - sizes.width)
        big = max(0.0, triangular - min(rectangular, cylindrical))
        penalty = float(np.sum((vector - inside) ** 2)) + narrow**2 + big**2
        return sizes, penalty / 100.0


def search(space: Space, setting: Setting, say: Callable[[str], None]) -> Sizes:
    """The best sizes from one seed: differential evolution on few points, then a simplex descent on more."""

    def value(vector: FloatArray, with_setting: Setting) -> float:
        sizes, penalty = space.sizes(vector)
        return objective(sizes, with_setting) + penalty

    coarse = Setting(COARSE_POINTS, setting.seed, setting.band_mm, setting.palm_share)
    coarse_value: Any = partial(value, with_setting=coarse)
    fine_value: Any = partial(value, with_setting=setting)
    generator = np.random.default_rng(setting.seed)
    limits = Bounds(*space.bounds())
    found = differential_evolution(
        coarse_value, limits, popsize=POPULATION, maxiter=GENERATIONS, tol=1e-3, polish=False, rng=generator
    )
    simplex: Any = {"maxfev": EVALUATIONS, "xatol": 0.2, "fatol": 1e-3}
    end = minimize(fine_value, found.x, method="Nelder-Mead", options=simplex)
    say(f"seed {setting.seed}: {found.fun:.3f} on {COARSE_POINTS} points, {end.fun:.3f} on {setting.points}")
    return space.sizes(end.x)[0]


def listed(sizes: Sizes) -> str:
    """One line of sizes, in the order --evaluate takes."""
    s = sizes
    leg = "" if s.leg == s.side else f" (legs {s.leg:.0f})"
    return (
        f"box {s.width:.0f} x {s.depth:.0f} x {s.height:.0f}, "
        f"cylinder radius {s.radius:.0f} x {s.cylinder_height:.0f}, "
        f"triangle side {s.side:.0f}{leg} x {s.triangle_height:.0f} mm"
    )


def table_lines(ours: Distances, table: CloudTable) -> list[str]:
    """Ours against the thesis, one line a pair; a pair off by more than FAR_OFF in mean or RMS is marked."""
    lines = [f"{table.source} clouds, mm".ljust(24) + HEADINGS]
    for i, cloud in enumerate(OBJECTS):
        for j, model in enumerate(OBJECTS):
            cells = ""
            for a, b in ((ours.mean, table.mean), (ours.rms, table.rms), (ours.largest, table.largest)):
                cells += f"   {a[i, j]:6.2f} {b[i, j]:6.2f} {a[i, j] / b[i, j]:5.2f}"
            worst = np.exp(max(abs(np.log(ours.mean / table.mean)[i, j]), abs(np.log(ours.rms / table.rms)[i, j])))
            off = "  off" if worst > FAR_OFF else ""
            own = "" if CROSS[i, j] else " (own)"
            lines.append(f"{cloud[:6]} to {model[:6]}{own}".ljust(24) + cells + off)
    return lines


def report(sizes: Sizes, setting: Setting) -> dict[str, object]:
    """Sizes, objective and all distances, ready for JSON."""
    results: dict[str, object] = {"sizes_mm": asdict(sizes), "objective": objective(sizes, setting)}
    for ours, (table, _) in zip(distances(sizes, setting), TABLES, strict=True):
        results[table.source] = {name: getattr(ours, name).round(3).tolist() for name in ("mean", "rms", "largest")}
    return results


def spread_lines(found: list[tuple[float, Sizes]]) -> list[str]:
    """How far the sizes near the best objective lie apart."""
    near = [astuple(sizes) for value, sizes in found if value <= NEAR_BEST * found[0][0]]
    names = [f.name for f in fields(Sizes)]
    count = f"{len(near)} of {len(found)} seeds"
    lines = [f"{count} end within {NEAR_BEST - 1:.0%} of the best objective; their sizes, mm:"]
    for name, values in zip(names, zip(*near, strict=True), strict=True):
        lines.append(f"  {name:16} {min(values):6.1f} to {max(values):6.1f}")
    return lines


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description="Search the sizes of the three test objects.")
    parser.add_argument("--seed", type=int, default=1, help="first seed; each restart adds one")
    parser.add_argument("--restarts", type=int, default=5, help="searches, each with its own seed and clouds")
    parser.add_argument("--heights", type=float, nargs=2, default=(120.0, 150.0), metavar=("LOW", "HIGH"))
    parser.add_argument("--narrowest", type=float, default=NARROWEST_MM, help="smallest width or diameter, mm")
    parser.add_argument("--isosceles", action="store_true", help="let two sides of the triangle differ from the base")
    parser.add_argument("--evaluate", type=float, nargs=7, metavar=("W", "D", "H", "R", "HC", "A", "HT"))
    parser.add_argument("--band-mm", type=float, default=BAND_MM, help="height band of a side grasp")
    parser.add_argument("--palm-share", type=float, default=PALM_SHARE, help="top-grasp points on the top face")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of text")
    return parser.parse_args()


def main() -> int:
    """Print the best sizes, or judge given ones."""
    args = arguments()
    final = Setting(FINAL_POINTS, 0, args.band_mm, args.palm_share)
    say: Callable[[str], None] = (lambda line: print(line, file=sys.stderr)) if args.json else print
    spread: list[str] = []
    if args.evaluate:
        sizes = Sizes(*[*args.evaluate, args.evaluate[5]])
    else:
        say(f"seeds {args.seed} to {args.seed + args.restarts - 1}")
        space = Space((args.heights[0], args.heights[1]), args.isosceles, args.narrowest)
        found = []
        for seed in range(args.seed, args.seed + args.restarts):
            candidate = search(space, Setting(FINE_POINTS, seed, args.band_mm, args.palm_share), say)
            found.append((objective(candidate, final), candidate))
            say(f"  {found[-1][0]:.3f} on {FINAL_POINTS} points: {listed(candidate)}")
        found.sort(key=lambda pair: pair[0])
        sizes, spread = found[0][1].rounded(), spread_lines(found)
    results = report(sizes, final)
    if args.json:
        print(json.dumps({"seed": args.seed, "restarts": args.restarts, **results, "spread": spread}, indent=2))
        return 0
    print("\n".join([*spread, f"{listed(sizes)}\nobjective {results['objective']:.3f} on {FINAL_POINTS} points"]))
    for ours, (table, _) in zip(distances(sizes, final), TABLES, strict=True):
        print("\n" + "\n".join(table_lines(ours, table)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
