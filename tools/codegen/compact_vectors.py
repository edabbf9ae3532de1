"""Write protocol/vectors/compact.json: compact snapshots of boards with their counts, from the plain definition in
taxel_protocol.compact.

python tools/codegen/compact_vectors.py            write it
python tools/codegen/compact_vectors.py --check    exit status 1 if the file on disk is stale

A vector is a board's life: snapshots in order, each acknowledged or not before the next one.
"""

import json
import random
import sys
from pathlib import Path
from typing import Any

from taxel_protocol import compact
from taxel_protocol.limits import COMPACT_TAXELS_MAX, PROTOCOL_VERSION

VECTORS = Path(__file__).resolve().parents[2] / "protocol" / "vectors"
SEED = 22
SNAPSHOTS = 12


def life(name: str, taxels: int, sigma: float, seed: int, start: int = 0, jumps: float = 0.01) -> dict[str, Any]:
    """Snapshots of a board with that noise, in which some taxels jump."""
    draw = random.Random(f"{SEED} {seed}")
    address = draw.randint(0x08, 0x77)
    means = [draw.uniform(0, 65535) if seed % 2 else draw.uniform(1800, 2600) for _ in range(taxels)]
    reference: compact.Reference | None = None
    waiting: compact.Reference | None = None
    time = draw.getrandbits(32)
    steps: list[dict[str, Any]] = []
    for scan in range(SNAPSHOTS):
        means = [draw.uniform(0, 65535) if draw.random() < jumps else mean for mean in means]
        counts = [min(max(round(draw.gauss(mean, sigma)), 0), 0xFFFF) for mean in means]
        acknowledged = waiting is not None and draw.random() < 0.8
        if acknowledged:
            reference, waiting = waiting, None
        candidate = reference is None or draw.random() < 0.6
        if reference is None:
            data = compact.encode_packed(address, scan, time, counts, candidate, start)
        else:
            data = compact.encode(address, scan, time, counts, reference, candidate)
        decoded = compact.decode(address, taxels, data, [reference] if reference else [])
        assert (decoded.sequence, decoded.timestamp_us, decoded.counts) == (scan, time, counts)
        waiting = decoded.candidate or waiting
        if candidate and data[2] & 0x1F:
            reference = None
        steps.append({"acknowledged": acknowledged, "timestamp_us": time, "counts": counts, "bytes": data.hex()})
        time = (time + draw.randint(1000, 400_000)) % 2**32
    return {"name": name, "address": address, "snapshots": steps}


def text() -> str:
    """The whole file."""
    noises = (0, 0.3, 1.5, 28, 300)
    lives = [life(f"noise_{sigma:g}", 27, sigma, 2 * i, 2 * (sigma > 100)) for i, sigma in enumerate(noises)]
    lives += [life("anywhere", 63, 4.0, 11), life("one_taxel", 1, 1.5, 12), life("jumps", 30, 1.5, 13, 0, 0.3)]
    lives += [life("longest", COMPACT_TAXELS_MAX, 20_000.0, 15, 3), life("largest", 121, 1.5, 16)]
    about = "compact snapshots: bytes and what they say"
    head = json.dumps({"about": about, "protocol_version": PROTOCOL_VERSION, "made_by": Path(__file__).name})
    lines = ",\n".join(json.dumps(one) for one in lives)
    return f'{head[:-1]}, "boards": [\n{lines}\n]}}\n'


def main() -> int:
    """Write or check the file."""
    path = VECTORS / "compact.json"
    if "--check" in sys.argv[1:]:
        if not path.exists() or path.read_text() != text():
            print(f"{path.name} is stale: run `make generate`", file=sys.stderr)
            return 1
        return 0
    path.write_text(text())
    return 0


if __name__ == "__main__":
    sys.exit(main())
