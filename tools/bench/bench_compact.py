"""Compact frames: what they take against the entropy of what they say, and the whole skin's rate with them.

The bytes are measured by tools/compact/entropy.py, whose heading says what is counted; here with shorter recordings.
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "compact"))

import numpy as np
from bench_skin_rate import SCANS
from entropy import SIGMAS, Tally
from entropy import measure as polled
from figures import Figure
from ideal import noise_entropy, recording_entropy

from taxel.hand import Hand, load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualMemoryLink, VirtualWorld
from taxel.skin import Skin

MOST = 1.1
"""Coded bytes over entropy that are allowed."""

WANTED_HZ, WANTED_SIGMA = 60.0, 1.5
SECONDS = 4.0
SETTLE_S, RUN_S = 3.0, 3.0
SCL_HZ = 400e3


def rate(hand: Hand, sigma: float) -> float:
    """Scans of the hand a second that arrive, firmware's costs and UART at 1 Mbaud included; virtual time."""
    settings = WorldSettings(scl_hz=SCL_HZ, noise_counts=sigma, scan=SCANS["fast"])
    with (
        VirtualWorld(format_world(hand, settings)) as world,
        Skin(VirtualMemoryLink(world), hand, frames="compact") as skin,
    ):
        frames = 0
        for seconds, counted in ((SETTLE_S, False), (RUN_S, True)):
            end = world.now_s + seconds
            while world.now_s < end:
                taken = len(skin.poll(0.005))
                frames += taken if counted else 0
    return frames / len(hand.boards) / RUN_S


def _figure(name: str, hand: Hand, tally: Tally, entropy: float) -> Figure:
    bits = 8.0 * (tally.coded + tally.packed) / (tally.cycles * hand.n_taxels)
    hertz = SCL_HZ / tally.clocks(len(hand.boards))
    detail = f"{bits:.3f} bits a taxel of {entropy:.3f}; the bus alone allows {hertz:.1f} Hz"
    return Figure(f"compact frames, {name}", MOST * entropy / bits, 1.0, f"{MOST:g} times the entropy", detail)


def measure() -> list[Figure]:
    """Bytes and rates at four strengths of noise, and bytes of a recording with touches."""
    hand = load_hand("allegro")
    figures = []
    for sigma in SIGMAS:
        tally = polled(hand, sigma, SECONDS, touched=False)
        figures.append(_figure(f"noise {sigma:g} counts", hand, tally, noise_entropy(sigma)))
        begun = time.perf_counter()
        found = rate(hand, sigma)
        figures.append(
            Figure(
                f"skin's rate with them, 400 kHz, noise {sigma:g} counts",
                found / WANTED_HZ,
                1.0 if sigma == WANTED_SIGMA else None,
                f"{WANTED_HZ:g} Hz",
                f"{found:.1f} Hz at the host, fast scan, 1 Mbaud ({time.perf_counter() - begun:.0f} s to emulate)",
            )
        )
    touched = polled(hand, WANTED_SIGMA, SECONDS, touched=True)
    entropy = recording_entropy(np.array(touched.counts, dtype=np.int64))
    return [*figures, _figure(f"noise {WANTED_SIGMA:g} counts and touches", hand, touched, entropy)]
