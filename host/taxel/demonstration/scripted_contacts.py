"""Scripted contacts on the emulated skin, and the response of the skin to each of them."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.hand import Hand
from taxel.hand.indentation import Indentation, compute_force_shares, compute_indentation_forces
from taxel.link import write_stimulus
from taxel.signal import Activation, BaselineResult
from taxel.skin import Skin, SkinFrame, open_skin
from taxel.stream import LossAccount

FIRST_CONTACT_S = 20.0
"""Start of the first contact in virtual seconds: later than discovery and a baseline of 100 samples at 19 scans/s."""

DEMO_CONTACTS = (
    Indentation("palm", 3.0, 5.0, 8.0, FIRST_CONTACT_S),
    Indentation("fingertip_index", 8.0, 4.0, 3.0, FIRST_CONTACT_S + 1.0),
    Indentation("fingertip_pinkie", 10.0, 4.0, 1.5, FIRST_CONTACT_S + 2.0),
    Indentation("proximal_front_middle", 6.0, 4.0, 5.0, FIRST_CONTACT_S + 3.0),
    Indentation("medial_front_pinkie", 2.0, 2.5, 2.0, FIRST_CONTACT_S + 4.0),
    Indentation("back_of_hand", 3.0, 8.0, 12.0, FIRST_CONTACT_S + 5.0, diameter_m=0.024),
    Indentation("palm", 10.0, 2.0, 0.5, FIRST_CONTACT_S + 6.0, diameter_m=0.0019),
)
"""Seven contacts on six boards: probes of at least 12 mm as in Figure 2.5 of the thesis, and one probe of 1.9 mm."""


MARGIN_S = 0.1
"""Time before and after a contact in which its taxels may be active, seconds: two scans of the default skin."""


@dataclass(frozen=True)
class ContactOutcome:
    """Response of the skin to one contact.

    delay_s: from the first contact to the end of the poll cycle with the first active taxel, seconds; None if no taxel
    became active. A cycle may begin before the contact, but the taxel was measured in it. active_taxels:
    indices into the hand's taxels that were active during the contact and bear a part of its force. largest_signal:
    counts below the baseline.
    """

    contact: Indentation
    delay_s: float | None
    active_taxels: list[int]
    largest_signal: float


@dataclass(frozen=True)
class DemonstrationResult:
    """Figures of the demonstration: the skin that was found, its baseline, and the response to each contact."""

    firmware: str
    protocol_version: int
    boards_found: int
    boards_missing: int
    rate_hz: float
    baseline_mean: float
    baseline_noise: float
    disturbed: int
    contacts: list[ContactOutcome]
    false_activations: int
    largest_signal: NDArray[np.float64]
    ever_active: NDArray[np.bool_]
    losses: LossAccount


def run_demonstration(hand: Hand, seed: int, advance: Callable[[str, float], None]) -> DemonstrationResult:
    """Start an emulated skin, take its baseline, apply the scripted contacts, and return the response.

    seed: of the emulated skin. advance: called with the name of the current step and its completed share, 0 to 1.
    """
    times, forces = compute_indentation_forces(hand, DEMO_CONTACTS)
    end = max(contact.end_s for contact in DEMO_CONTACTS) + 0.5
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        stimulus = Path(folder) / "presses.stm"
        write_stimulus(stimulus, times, forces)
        advance("booting", 0.0)
        with open_skin(f"emulator:?speed=max&seed={seed}&stimulus={stimulus}", hand) as skin:
            advance("booting", 1.0)
            baseline = skin.take_baseline(progress=lambda fraction: advance("baseline, 100 samples", fraction))
            scans = _collect_scans_until(skin, end, advance)
            return _summarise(skin, scans, baseline)


def _collect_scans_until(skin: Skin, end_s: float, advance: Callable[[str, float], None]) -> list[SkinFrame]:
    """Collect the frames of the whole skin up to the time `end_s` of the stream, seconds.

    advance: called with the name of the step and its completed share, 0 to 1.
    """
    scans = []
    for scan in skin.scans():
        scans.append(scan)
        advance("pressing", min(1.0, scan.time_s / end_s))
        if scan.time_s >= end_s:
            break
    return scans


def _summarise(skin: Skin, scans: list[SkinFrame], baseline: BaselineResult) -> DemonstrationResult:
    """Return the result of the demonstration: figures of the skin, its baseline, and the response to each contact.

    The response follows from a comparison of the active taxels of the scans with the taxels that each contact loads.
    """
    activation = Activation(baseline.mean)
    times = np.array([scan.time_s for scan in scans])
    ends = np.append(times[1:], 2.0 * times[-1] - times[-2])  # a cycle ends where the next one begins
    frames = activation(np.stack([scan.raw_counts for scan in scans]), np.stack([scan.valid for scan in scans]))
    signal = np.nan_to_num(frames.signal_counts, nan=0.0)
    outcomes = []
    expected = np.zeros_like(frames.active)
    for contact in DEMO_CONTACTS:
        is_loaded = compute_force_shares(skin.hand, contact) > 0.0
        during = (times >= contact.start_s - MARGIN_S) & (times <= contact.end_s + MARGIN_S)
        active = frames.active & during[:, None] & is_loaded
        expected |= during[:, None] & is_loaded
        active_scans = np.flatnonzero(active.any(axis=1))
        outcomes.append(
            ContactOutcome(
                contact,
                None if not len(active_scans) else float(ends[active_scans[0]] - contact.start_s),
                np.flatnonzero(active.any(axis=0)).tolist(),
                float(signal[np.ix_(during, is_loaded)].max(initial=0.0)),
            )
        )
    handshake = skin.hub.last_handshake or {}
    return DemonstrationResult(
        firmware=f"{handshake['firmware_major']}.{handshake['firmware_minor']}.{handshake['firmware_patch']}",
        protocol_version=handshake["version_chosen"],
        boards_found=len(skin.hub.boards),
        boards_missing=len(skin.missing_boards),
        rate_hz=(len(scans) - 1) / (times[-1] - times[0]),
        baseline_mean=float(np.nanmean(baseline.mean)),
        baseline_noise=float(np.nanmean(baseline.noise)),
        disturbed=int(baseline.disturbed.sum()),
        contacts=outcomes,
        false_activations=int((frames.active & ~expected).sum()),
        largest_signal=signal.max(axis=0),
        ever_active=np.asarray(frames.active.any(axis=0)),
        losses=skin.losses,
    )
