"""Random sampling of the streams of the blind check over time."""

from __future__ import annotations

import secrets
from typing import Final

import numpy as np

from taxel.blind.catalogue_causes import EFFECT_NAMES, list_cause_types
from taxel.blind.cause_types import CauseType
from taxel.blind.hidden import HiddenCauses
from taxel.blind.out_of_catalogue import OUT_OF_CATALOGUE
from taxel.blind.sampling import SALT_BYTES, find_strength
from taxel.blind.streams.world import StreamWorld
from taxel.hand import Hand, load_hand

HAND: Final = "rig4"

SHARES: Final = {"none": 1 / 3, "single": 1 / 2, "outside": 1 / 6}
"""Shares of streams without a fault, with a fault of the catalogue, and with a fault outside the catalogue."""

FLOORS: Final = (2.0, 6.0)
"""Range of the size of a fault, in floors: the check measures the detection of faults of two floors or more."""

ONSET_SHARES: Final = (0.2, 0.5)
"""Range of the onset as a share of the stream's length: enough contacts remain for naming the cause."""

LASTING_SHARE: Final = 0.5
"""Duration of a lasting contact, as a share of the stream's length; half of the streams without a fault have one."""

TEMPERATURE_COUNTS: Final = (20.0, 60.0)
TEMPERATURE_SECONDS: Final = (900.0, 3000.0)
"""Ranges of standard deviation and correlation time of a board's temperature drift in a stream."""


def sample_streams(count: int, hours: float, seed: int | None = None) -> list[StreamWorld]:
    """Sample the worlds of `count` streams: hidden faults, their onsets, and seeds. hours: length of each stream.

    seed: seed for reproducible streams; None: random numbers of the operating system, as a sealed check requires.
    """
    rng = np.random.default_rng(secrets.randbits(256) if seed is None else seed)
    kinds = [kind for kind, share in SHARES.items() for _ in range(round(share * count))]
    kinds = (kinds + ["single"] * count)[:count]
    hand = load_hand(HAND)
    names = _sample_evenly(list(EFFECT_NAMES), rng, kinds.count("single"))
    order = rng.permutation(count)
    worlds = []
    for number, index in enumerate(order.tolist()):
        kind = kinds[index]
        cause_type = None
        if kind == "single":
            types = list_cause_types(names.pop())
            cause_type = types[int(rng.integers(len(types)))]
        elif kind == "outside":
            cause_type = OUT_OF_CATALOGUE[int(rng.integers(len(OUT_OF_CATALOGUE)))]
        worlds.append(_sample_stream(number, kind, cause_type, hand, hours, rng, seed is None))
    return worlds


def _sample_evenly(names: list[str], rng: np.random.Generator, count: int) -> list[str]:
    """Return `count` names in random order in which each name occurs about equally often."""
    found: list[str] = []
    while len(found) < count:
        found += rng.permutation(names).tolist()
    return found[:count]


def _sample_stream(
    number: int,
    kind: str,
    cause_type: CauseType | None,
    hand: Hand,
    hours: float,
    rng: np.random.Generator,
    sealed: bool,
) -> StreamWorld:
    """Sample the world of one stream.

    kind: "none", "single" (a cause of the catalogue) or "outside" (another cause). cause_type: type of the fault; None:
    no fault. sealed: whether the salt is secret; otherwise the salt follows from the seed. Half of the streams without
    a fault have a lasting contact that is not announced.
    """
    strength = find_strength(float(rng.uniform(*FLOORS)))
    causes = () if cause_type is None else (cause_type.sample(rng, hand, strength),)
    # Every skin has these deviations, also without a fault.
    nuisances = (
        f"gain electrode log_std={rng.uniform(0.005, 0.02):.4f}",
        f"drift wander counts={rng.uniform(*TEMPERATURE_COUNTS):.1f} seconds={rng.uniform(*TEMPERATURE_SECONDS):.0f}",
        f"noise pink counts={rng.uniform(1.0, 3.0):.2f}",
    )
    seconds = 3600.0 * hours
    onset = None if cause_type is None else float(rng.uniform(*ONSET_SHARES)) * seconds
    lasting = None
    if cause_type is None and rng.uniform() < 0.5:
        start = float(rng.uniform(0.1, 0.9 - LASTING_SHARE)) * seconds
        lasting = (start, start + LASTING_SHARE * seconds)
    salt = secrets.token_hex(SALT_BYTES) if sealed else rng.bytes(SALT_BYTES).hex()
    return StreamWorld(
        number, int(rng.integers(2**31)), HiddenCauses(kind, causes, nuisances), hours, onset, lasting, salt
    )
