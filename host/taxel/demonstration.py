"""The scripted presses of the demonstration, and what the skin makes of them."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.hand import Hand
from taxel.hand.press import Press, press_forces, share_of_force
from taxel.link import write_stimulus
from taxel.signal import Activation, BaselineResult
from taxel.skin import Skin, SkinFrame, open_skin
from taxel.stream import LossAccount

FIRST_PRESS_S = 20.0
"""Virtual seconds: after discovery and a baseline of 100 samples at 19 scans a second, with room to spare."""

DEMO_PRESSES = (
    Press("palm", 6.0, 5.0, 8.0, FIRST_PRESS_S),
    Press("fingertip_index", 6.0, 4.0, 3.0, FIRST_PRESS_S + 1.0),
    Press("fingertip_thumb", 8.0, 4.0, 1.5, FIRST_PRESS_S + 2.0),
    Press("proximal_front_middle", 5.0, 5.0, 5.0, FIRST_PRESS_S + 3.0),
    Press("medial_front_pinkie", 4.0, 1.5, 2.0, FIRST_PRESS_S + 4.0),
    Press("back_of_hand", 3.0, 8.0, 12.0, FIRST_PRESS_S + 5.0, diameter_m=0.024),
    Press("palm", 10.0, 2.0, 0.5, FIRST_PRESS_S + 6.0, diameter_m=0.0019),
)
"""Seven presses on six boards: probes of 12 mm and more as in the thesis's Figure 2.5, and one of 1.9 mm."""


@dataclass(frozen=True)
class PressOutcome:
    """What the skin felt of one press.

    `delay_s`: from first contact to the first active taxel, None if none; `active_taxels`: indices into the hand's
    taxels that were active while it was pressed and carry part of its force; `largest_drop`: counts.
    """

    press: Press
    delay_s: float | None
    active_taxels: list[int]
    largest_drop: float


@dataclass(frozen=True)
class PressResult:
    """Everything that the demonstration shows."""

    firmware: str
    protocol_version: int
    boards_found: int
    boards_missing: int
    rate_hz: float
    baseline_mean: float
    baseline_noise: float
    disturbed: int
    presses: list[PressOutcome]
    false_activations: int
    largest_drop: NDArray[np.float64]
    ever_active: NDArray[np.bool_]
    losses: LossAccount


def press_the_skin(hand: Hand, seed: int, advance: Callable[[str, float], None]) -> PressResult:
    """Boot an emulated skin of `hand`, take its baseline, press it, and report. `advance(step, fraction)` is called
    on the way.
    """
    times, forces = press_forces(hand, DEMO_PRESSES)
    end = max(press.end_s for press in DEMO_PRESSES) + 0.5
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        stimulus = Path(folder) / "presses.stm"
        write_stimulus(stimulus, times, forces)
        advance("booting", 0.0)
        with open_skin(f"emulator:?speed=max&seed={seed}&stimulus={stimulus}", hand) as skin:
            advance("booting", 1.0)
            baseline = skin.take_baseline(progress=lambda fraction: advance("baseline, 100 samples", fraction))
            scans = _scans_until(skin, end, advance)
            return _report(skin, scans, baseline)


def _scans_until(skin: Skin, end_s: float, advance: Callable[[str, float], None]) -> list[SkinFrame]:
    scans = []
    for scan in skin.scans():
        scans.append(scan)
        advance("pressing", min(1.0, scan.time_s / end_s))
        if scan.time_s >= end_s:
            break
    return scans


def _report(skin: Skin, scans: list[SkinFrame], baseline: BaselineResult) -> PressResult:
    activation = Activation(baseline.mean)
    times = np.array([scan.time_s for scan in scans])
    frames = activation(np.stack([scan.raw_counts for scan in scans]), np.stack([scan.valid for scan in scans]))
    drop = np.nan_to_num(frames.drop, nan=0.0)
    shares = [share_of_force(skin.hand, press) for press in DEMO_PRESSES]
    outcomes = []
    expected = np.zeros_like(frames.active)
    for press, share in zip(DEMO_PRESSES, shares, strict=True):
        during = (times >= press.start_s - 0.1) & (times <= press.end_s + 0.1)
        felt = frames.active & during[:, None] & (share > 0.0)
        expected |= during[:, None] & (share > 0.0)
        first = np.flatnonzero(felt.any(axis=1))
        outcomes.append(
            PressOutcome(
                press,
                None if not len(first) else float(times[first[0]] - press.start_s),
                np.flatnonzero(felt.any(axis=0)).tolist(),
                float(drop[np.ix_(during, share > 0.0)].max(initial=0.0)),
            )
        )
    hello = skin.hub.hello or {}
    return PressResult(
        firmware=f"{hello['firmware_major']}.{hello['firmware_minor']}.{hello['firmware_patch']}",
        protocol_version=hello["version_chosen"],
        boards_found=len(skin.hub.boards),
        boards_missing=len(skin.missing_boards),
        rate_hz=(len(scans) - 1) / (times[-1] - times[0]),
        baseline_mean=float(np.nanmean(baseline.mean)),
        baseline_noise=float(np.nanmean(baseline.noise)),
        disturbed=int(baseline.disturbed.sum()),
        presses=outcomes,
        false_activations=int((frames.active & ~expected).sum()),
        largest_drop=drop.max(axis=0),
        ever_active=np.asarray(frames.active.any(axis=0)),
        losses=skin.losses,
    )
