"""Blind check of the twin over hours of use; prints its score, `make blind-streams`.

Example: python tools/twin/blind_streams.py --streams 6 --hours 0.5 --seed 1 --out out/streams
"""

import argparse
import json
import sys
from pathlib import Path

from taxel.blind.streams.run import run_streams, seal_streams
from taxel.blind.streams.sampling import sample_streams
from taxel.blind.streams.score import format_score, score_streams
from taxel.errors import TaxelError
from taxel.output import write_whole


def main() -> int:
    """Run the streams of the check, score them and print the score; the exit status is 1 after a one-line error
    message.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--streams", type=int, default=150)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--seed", type=int, help="default: random streams")
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--out", type=Path, default=Path("out/streams"))
    parser.add_argument("--score-only", action="store_true", help="score the finished streams of the folder")
    options = parser.parse_args()
    try:
        if not options.score_only:
            worlds = sample_streams(options.streams, options.hours, options.seed)
            seal_streams(options.out, worlds)
            run_streams(
                options.out,
                worlds,
                options.jobs,
                lambda done, total: print(f"{done} of {total} streams", file=sys.stderr, flush=True),
            )
        paths = [path for path in options.out.glob("*.json") if path.stem.isdecimal()]
        results = [json.loads(path.read_text()) for path in sorted(paths, key=lambda path: int(path.stem))]
        score = score_streams(results, options.out)
    except TaxelError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    write_whole(options.out / "score.json", json.dumps(score, indent=1))
    print(format_score(score))
    return 0


if __name__ == "__main__":
    sys.exit(main())
