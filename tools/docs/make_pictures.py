"""Make the pictures of README.md again: `python tools/docs/make_pictures.py` (`make pictures`).

    docs/images/skin.png   the emulated skin with contacts (taxel feel)
    docs/images/gap.png    the unrolled hand before and after the named effect was added (taxel demo)

The demonstration is repeated with the seeds 1, 2, ... until the verdict is right and names an effect; the seed is
printed. Existing pictures are replaced only after all have been made.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
IMAGES: Final = ROOT / "docs" / "images"
SEEDS: Final = range(1, 9)


class PictureError(Exception):
    """A picture cannot be made; the message is one line."""


def main() -> int:
    """Make the pictures of README.md; the exit status is 1 if a command fails or every demonstration is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=IMAGES, help="folder of the pictures (default: docs/images)")
    out = parser.parse_args().out
    with tempfile.TemporaryDirectory(prefix="taxel-pictures-") as name:
        folder = Path(name)
        try:
            run_taxel("feel", "--seconds", "1", "--out", str(folder / "feel"))
            made = {"skin.png": folder / "feel" / "skin.png", "gap.png": find_right_demonstration(folder)}
        except PictureError as error:
            print(f"make_pictures: {error}", file=sys.stderr)
            return 1
        out.mkdir(parents=True, exist_ok=True)
        for picture, path in made.items():
            shutil.copyfile(path, out / picture)
            print(out / picture)
    return 0


def run_taxel(*arguments: str) -> str:
    """Run `taxel` with these arguments and return its standard output. Raises PictureError if the command fails."""
    command = [str(Path(sys.executable).with_name("taxel")), *arguments]
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode:
        last = (result.stderr.strip().splitlines() or ["no message"])[-1]
        raise PictureError(f"taxel {' '.join(arguments)} ended with status {result.returncode}: {last}")
    return result.stdout


def find_right_demonstration(folder: Path) -> Path:
    """Run demonstrations in `folder` until one diagnoses its hidden effect correctly; return its picture of the hand.

    A demonstration (`taxel demo`) hides an effect, or nothing, in the emulated skin and diagnoses the skin; it prints
    RIGHT if the diagnosis is correct. Raises PictureError if no demonstration with a seed of `SEEDS` is right.
    """
    for seed in SEEDS:
        out = folder / f"demo{seed}"
        output = run_taxel("demo", "--seed", str(seed), "--out", str(out))
        verdict = next((line for line in output.splitlines() if line.startswith(("RIGHT", "WRONG"))), "no verdict")
        print(f"seed {seed}: {verdict}", flush=True)
        if verdict.startswith("RIGHT") and "hidden: nothing" not in output and (out / "hand.png").exists():
            return out / "hand.png"
    raise PictureError(f"no demonstration with the seeds {SEEDS.start} to {SEEDS.stop - 1} is right")


if __name__ == "__main__":
    sys.exit(main())
