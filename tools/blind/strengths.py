"""How strong the causes are that the blind check draws: gap over floor of every form, from weakest to strongest.

    python tools/blind/strengths.py [--forms "spread film,noise pink"] [--strengths 0,0.5,1] [--worlds 2] [--seed 0]

Worlds of `host/taxel/blind/kinds.py` hold one cause each and are pressed as a blind check presses them; nothing is
diagnosed. `FLOORS` in `drawing.py` says how far a gap is to lie above the floor at strength 0 and 1: gap over floor is
the root of one more than its square, 1.1 and 6.1. Where a form is far from that, its range in `kinds.py` is wrong.
A cause that acts on one board or line hangs on whether presses reach it: look at the median of several worlds. A world
takes about 8 s of one core.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import zlib
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Final

import numpy as np

from taxel.blind.drawing import SMALL, World
from taxel.blind.form import Form
from taxel.blind.hidden import Hidden
from taxel.blind.kinds import INSIDE, nuisances
from taxel.blind.making import make_world
from taxel.blind.strangers import LOOKALIKES, OUTSIDE
from taxel.errors import TaxelError
from taxel.gap.metric import measure
from taxel.gap.pair import read_pair
from taxel.gap.prepare import prepared
from taxel.hand import load_hand

FORMS: Final = {form.form: form for form in (*INSIDE, *OUTSIDE, *LOOKALIKES)}
HAND: Final = "rig4"


def main(arguments: list[str]) -> int:
    """The table on standard output."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--forms", help="separated by commas; else all")
    parser.add_argument("--strengths", default="0,0.5,1", help="between 0 and 1, separated by commas")
    parser.add_argument("--worlds", type=int, default=2, help="of each form and strength")
    parser.add_argument("--seed", type=int, default=0, help="of the draws")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="worlds at a time")
    given = parser.parse_args(arguments)
    names = list(FORMS) if given.forms is None else [name.strip() for name in given.forms.split(",")]
    for name in names:
        if name not in FORMS:
            parser.error(f"--forms: no form '{name}'; choose from: {', '.join(FORMS)}")
    try:
        strengths = [float(word) for word in given.strengths.split(",")]
    except ValueError:
        strengths = []
    if not strengths or not all(0.0 <= strength <= 1.0 for strength in strengths):
        parser.error(f"--strengths: expected numbers from 0 to 1, separated by commas, found '{given.strengths}'")
    if min(given.worlds, given.jobs) < 1:
        parser.error("--worlds, --jobs: expected at least 1")
    found: dict[tuple[str, float], list[float]] = {}
    with ProcessPoolExecutor(given.jobs) as pool:
        jobs = {
            pool.submit(ratio_of, name, strength, [given.seed, number, zlib.crc32(name.encode())]): (name, strength)
            for name in names
            for strength in strengths
            for number in range(given.worlds)
        }
        for place, job in enumerate(as_completed(jobs), 1):
            found.setdefault(jobs[job], []).append(job.result())
            print(f"\r{place} of {len(jobs)} worlds", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    print("| form | " + " | ".join(f"{strength:g}" for strength in strengths) + " |")
    print("|---" * (len(strengths) + 1) + "|")
    for name in names:
        rows = [sorted(found[name, strength]) for strength in strengths]
        cells = [f"{np.median(own):.1f} ({own[0]:.1f} to {own[-1]:.1f})" for own in rows]
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
    return 0


def ratio_of(name: str, strength: float, seed: list[int]) -> float:
    """Gap over floor of one world; NaN where no plan could be pressed."""
    rng = np.random.default_rng(seed)
    form: Form = FORMS[name]
    hidden = Hidden("single", (form.draw(rng, load_hand(HAND), strength),), nuisances(rng))
    world = World(0, HAND, int(rng.integers(2**62)), hidden, "", shape=SMALL)
    with tempfile.TemporaryDirectory() as folder:
        real, sim = Path(folder, "real.h5"), Path(folder, "sim.h5")
        try:
            make_world(world, real, sim)
        except TaxelError:
            return float("nan")
        judge = prepared(read_pair(real, sim)).judge
        gap = measure(judge.sessions, judge.state.mean, judge.layout)
    return gap.gap.value / gap.floor


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
