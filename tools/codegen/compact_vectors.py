"""Write protocol/vectors/compact.json: compact snapshots of boards with their counts, from the definition in
taxel_protocol.compact.

python tools/codegen/compact_vectors.py            write it
python tools/codegen/compact_vectors.py --check    exit status 1 if the file on disk is stale

A vector is the history of one board: its snapshots in order, and whether each was acknowledged before the next.
"""

import json
import random
import sys
from pathlib import Path
from typing import Any

from generated_files import write_or_check

from taxel_protocol import compact
from taxel_protocol.limits import COMPACT_TAXELS_MAX, COMPACT_WIDTH_MASK, PROTOCOL_VERSION

VECTORS = Path(__file__).resolve().parents[2] / "protocol" / "vectors"
SEED = 22
SNAPSHOTS = 12


def simulate_history(
    name: str, taxels: int, sigma: float, seed: int, start: int = 0, jumps: float = 0.01
) -> dict[str, Any]:
    """Simulate the history of one board: its compact snapshots in order, as a test vector.

    sigma: standard deviation of the noise in counts. seed: the same seed gives the same history; with an odd seed the
    first means lie anywhere in the 16-bit range. start: initial scale of the prediction (bits 5 and 6 of the format
    byte) in snapshots without an earlier key frame. jumps: share of the taxels whose mean count jumps at each scan. A
    snapshot without an earlier key frame is a key frame itself, any other one with a probability of 0.6. A pending key
    frame is acknowledged before the next snapshot with a probability of 0.8.
    """
    draw = random.Random(f"{SEED} {seed}")
    address = draw.randint(0x08, 0x77)
    means = [draw.uniform(0, 65535) if seed % 2 else draw.uniform(1800, 2600) for _ in range(taxels)]
    key_frame: compact.KeyFrame | None = None
    pending: compact.KeyFrame | None = None
    time = draw.getrandbits(32)
    steps: list[dict[str, Any]] = []
    for scan in range(SNAPSHOTS):
        means = [draw.uniform(0, 65535) if draw.random() < jumps else mean for mean in means]
        counts = [min(max(round(draw.gauss(mean, sigma)), 0), 0xFFFF) for mean in means]
        acknowledged = pending is not None and draw.random() < 0.8
        if acknowledged:
            key_frame, pending = pending, None
        is_key_frame = key_frame is None or draw.random() < 0.6
        if key_frame is None:
            data = compact.encode_packed(address, scan, time, counts, is_key_frame, start)
        else:
            data = compact.encode(address, scan, time, counts, key_frame, is_key_frame)
        decoded = compact.decode(address, taxels, data, [key_frame] if key_frame else [])
        assert (decoded.sequence, decoded.timestamp_us, decoded.counts) == (scan, time, counts)
        pending = decoded.key_frame or pending
        if is_key_frame and data[2] & COMPACT_WIDTH_MASK:  # a packed key frame discards the earlier one
            key_frame = None
        steps.append({"acknowledged": acknowledged, "timestamp_us": time, "counts": counts, "bytes": data.hex()})
        time = (time + draw.randint(1000, 400_000)) % 2**32
    return {"name": name, "address": address, "snapshots": steps}


def format_text() -> str:
    """Format the file of test vectors of compact frames.

    The histories differ in noise (standard deviation in counts), number of taxels and share of jumping means. Large
    noise starts with a larger scale of the prediction. The arguments of `simulate_history` are name, number of taxels,
    standard deviation of the noise, seed, initial scale and share of jumping means.
    """
    noises = (0, 0.3, 1.5, 28, 300)
    histories = [
        simulate_history(f"noise_{sigma:g}", 27, sigma, 2 * i, 2 * (sigma > 100)) for i, sigma in enumerate(noises)
    ]
    histories += [
        simulate_history("anywhere", 63, 4.0, 11),
        simulate_history("one_taxel", 1, 1.5, 12),
        simulate_history("jumps", 30, 1.5, 13, 0, 0.3),
    ]
    histories += [
        simulate_history("longest", COMPACT_TAXELS_MAX, 20_000.0, 15, 3),
        simulate_history("largest", 121, 1.5, 16),
    ]
    about = "compact snapshots: bytes, timestamps and counts"
    head = json.dumps({"about": about, "protocol_version": PROTOCOL_VERSION, "made_by": Path(__file__).name})
    lines = ",\n".join(json.dumps(history) for history in histories)
    return f'{head[:-1]}, "boards": [\n{lines}\n]}}\n'


def main() -> int:
    """Write the file of test vectors of compact frames, or check that it is up to date."""
    return write_or_check({VECTORS / "compact.json": format_text()})


if __name__ == "__main__":
    sys.exit(main())
