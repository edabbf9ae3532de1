"""Compact frames: coded size compared with the entropy of the counts, and the scan rate of the whole skin.

tools/compact/entropy.py counts the bytes and documents what is counted; the recordings here are shorter.
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "compact"))

import numpy as np
from bench_skin_rate import SCANS
from entropy import SIGMAS, Tally
from entropy import measure as measure_bytes
from figures import Figure
from ideal import compute_noise_entropy, compute_recording_entropy

from taxel.hand import Hand, load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualMemoryLink, VirtualWorld
from taxel.skin import Skin

ENTROPY_RATIO_MAX = 1.1
"""Largest allowed ratio of coded bytes to entropy."""

REQUIRED_HZ, REQUIRED_SIGMA = 60.0, 1.5
SECONDS = 4.0
SETTLE_S, RUN_S = 3.0, 3.0
SCL_HZ = 400e3


def measure_rate(hand: Hand, sigma: float) -> float:
    """Measure the scans of the whole hand per second of virtual time that arrive at the host.

    The processor costs of the firmware and a UART at 1 Mbaud are included. sigma: standard deviation of the noise,
    counts.
    """
    settings = WorldSettings(scl_hz=SCL_HZ, noise_counts=sigma, scan=SCANS["fast"])
    with (
        VirtualWorld(format_world(hand, settings)) as world,
        Skin(VirtualMemoryLink(world), hand, frames="compact") as skin,
    ):
        frames = 0
        for seconds, is_counted in ((SETTLE_S, False), (RUN_S, True)):
            end = world.now_s + seconds
            while world.now_s < end:
                received = len(skin.poll(0.005))
                frames += received if is_counted else 0
    return frames / len(hand.boards) / RUN_S


def _make_figure(name: str, hand: Hand, tally: Tally, entropy: float) -> Figure:
    """Create the row of the report that compares the coded bytes of compact frames with the entropy of their counts.

    tally: bytes sent by the emulated boards. entropy: bits per taxel.
    """
    bits = 8.0 * (tally.coded + tally.packed) / (tally.cycles * hand.n_taxels)
    hertz = SCL_HZ / tally.count_clocks(len(hand.boards))
    detail = f"{bits:.3f} bits per taxel, entropy {entropy:.3f}; the bus alone allows {hertz:.1f} Hz"
    requirement = f"{ENTROPY_RATIO_MAX:g} times the entropy"
    return Figure(f"compact frames, {name}", ENTROPY_RATIO_MAX * entropy / bits, 1.0, requirement, detail)


def measure() -> list[Figure]:
    """Run the benchmark of compact frames.

    It measures bytes and rates at four noise levels, and bytes of a recording with contacts.
    """
    hand = load_hand("original")
    figures = []
    for sigma in SIGMAS:
        tally = measure_bytes(hand, sigma, SECONDS, has_contacts=False)
        figures.append(_make_figure(f"noise {sigma:g} counts", hand, tally, compute_noise_entropy(sigma)))
        start = time.perf_counter()
        hertz = measure_rate(hand, sigma)
        figures.append(
            Figure(
                f"skin rate with compact frames, 400 kHz, noise {sigma:g} counts",
                hertz / REQUIRED_HZ,
                1.0 if sigma == REQUIRED_SIGMA else None,
                f"{REQUIRED_HZ:g} Hz",
                f"{hertz:.1f} Hz at the host, fast scan, 1 Mbaud ({time.perf_counter() - start:.0f} s to emulate)",
            )
        )
    tally = measure_bytes(hand, REQUIRED_SIGMA, SECONDS, has_contacts=True)
    entropy = compute_recording_entropy(np.array(tally.counts, dtype=np.int64))
    return [*figures, _make_figure(f"noise {REQUIRED_SIGMA:g} counts and contacts", hand, tally, entropy)]
