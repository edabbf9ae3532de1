"""Score of the blind check over time."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from taxel.blind.seal import verify_commitment
from taxel.blind.streams.world import StreamWorld
from taxel.gap.calibration.calibration import NAMED_PROBABILITY, NO_GAP, UNKNOWN

Result = dict[str, Any]
"""Result of a stream, as stored in its file: world, events, end times of the announced contacts; or an error."""

FORBIDDEN = 0.8
"""Probability from which a wrong cause is scored as a wrong statement, as in the blind check of the diagnosis."""


def score_streams(results: Sequence[Result], out: Path) -> dict[str, Any]:
    """Score the results of streams; return the figures as JSON values.

    out: folder with the commitments. Raises SealBrokenError for a world that does not match its commitment.
    """
    committed = json.loads((out / "commitments.json").read_text())
    for result in results:
        world = result["world"]
        verify_commitment(world["number"], world, committed[str(world["number"])])
    made = [(StreamWorld.from_json(result["world"]), result) for result in results if "error" not in result]
    faulty = [(world, result) for world, result in made if world.onset_s is not None]
    found = [_score_fault(world, result) for world, result in faulty]
    detected = [one for one in found if one["detected"]]
    hours, false = _count_false_alarms(made)
    delays = [one["delay_contacts"] for one in detected]
    placed = [one["place"] for one in detected if one["place"] is not None]
    return {
        "streams": len(made),
        "streams_without_fault": len(made) - len(faulty),
        "fault_free_hours": hours,
        "false_alarms": false,
        "false_alarms_per_24h": 24.0 * false / hours if hours else None,
        # Exact upper bound of a Poisson rate (Garwood, Biometrika 28 (1936) 437).
        "false_alarms_per_24h_upper_95": 24.0 * float(chi2.ppf(0.95, 2 * (false + 1))) / 2 / hours if hours else None,
        "faults": len(found),
        "detected_share": len(detected) / len(found) if found else None,
        "median_delay_contacts": float(np.median(delays)) if delays else None,
        "located_share": float(np.mean(placed)) if placed else None,
        "naming": {str(count): _score_names(found, count) for count in (1, 10, 30, 100)},
        "each": found,
    }


def _score_fault(world: StreamWorld, result: Result) -> dict[str, Any]:
    """Score the result of one stream with a fault.

    The first alarm after the onset counts as the detection of the fault; the values that depend on this alarm are None
    for an undetected fault. delay_contacts: number of contacts that ended between onset and alarm.
    """
    onset = result["start_s"] + (world.onset_s or 0.0)
    alarms = [event for event in result["events"] if event["event"] == "alarm" and event["time_s"] >= onset]
    cause = world.hidden.causes[0]
    first = alarms[0] if alarms else None
    contacts = np.array(result["contacts"])
    delay = None if first is None else int(((contacts > onset) & (contacts <= first["time_s"] + 1e-6)).sum())
    names = {
        event["contacts"]: event["probabilities"]
        for event in result["events"]
        if event["event"] == "cause" and event["time_s"] >= onset
    }
    return {
        "number": world.number,
        "cause": cause.name,
        "effect": cause.emulator_effect,
        "lines": list(cause.lines),
        "detected": first is not None,
        "delay_contacts": delay,
        "quantity": first["quantity"] if first else None,
        "found_place": first["place"] if first else None,
        "place": None if first is None else _is_place_correct(world, first),
        "onset_covered": None if first is None else first["onset_ci95"][0] <= onset <= first["onset_ci95"][1],
        "names": {str(count): value for count, value in names.items()},
    }


def _is_place_correct(world: StreamWorld, alarm: dict[str, Any]) -> bool | None:
    """Whether an alarm is on a board of the fault; None for a fault of the whole skin.

    An alarm for the whole skin is not correct for a fault of some boards.
    """
    cause = world.hidden.causes[0]
    boards = {location.address for location in cause.locations}
    for line in cause.lines:
        boards |= {int(word.removeprefix("board="), 16) for word in line.split() if word.startswith("board=0x")}
    if not boards or alarm["place"]["level"] == "skin":
        return None if not boards else False
    return int(alarm["place"]["address"], 16) in boards


def _count_false_alarms(made: Sequence[tuple[StreamWorld, Result]]) -> tuple[float, int]:
    """Return the number of hours before the onset of the fault, over all streams, and the number of alarms in them.

    In a stream without a fault, all hours count.
    """
    hours, false = 0.0, 0
    for world, result in made:
        onset = result["start_s"] + (world.onset_s if world.onset_s is not None else 3600.0 * world.hours)
        hours += (onset - result["start_s"]) / 3600.0
        false += sum(event["event"] == "alarm" and event["time_s"] < onset for event in result["events"])
    return hours, false


def _score_names(found: Sequence[dict[str, Any]], count: int) -> dict[str, Any]:
    """Score the causes that the twin names from the first `count` contacts after the onset.

    Faults for which the twin has named no cause from this number of contacts are left out. Returns five values:
    "known", "first_share": number of faults of the catalogue, and share of them for which the true cause is the most
    probable. "unknown", "reported_unknown_share": number of faults outside the catalogue, and share of them that is
    reported as unknown. "wrong_share": share of all these faults with a wrong statement, which is a wrong cause with a
    probability of `FORBIDDEN` or more. A share is None if there are no such faults.
    """
    known = [one for one in found if str(count) in one["names"] and one["cause"] != UNKNOWN]
    unknown = [one for one in found if str(count) in one["names"] and one["cause"] == UNKNOWN]
    first = [_first_cause(one["names"][str(count)]) == one["cause"] for one in known]
    wrong = [
        any(
            value >= FORBIDDEN for name, value in one["names"][str(count)].items() if name not in (one["cause"], NO_GAP)
        )
        for one in [*known, *unknown]
    ]
    reported = [_is_unknown(one["names"][str(count)]) for one in unknown]
    return {
        "known": len(known),
        "first_share": float(np.mean(first)) if first else None,
        "unknown": len(unknown),
        "reported_unknown_share": float(np.mean(reported)) if reported else None,
        "wrong_share": float(np.mean(wrong)) if wrong else None,
    }


def _first_cause(probabilities: dict[str, float]) -> str:
    """Return the most probable cause."""
    return max((name for name in probabilities if name != NO_GAP), key=lambda name: probabilities[name])


def _is_unknown(probabilities: dict[str, float]) -> bool:
    """Whether no effect of the catalogue is named."""
    return not any(value >= NAMED_PROBABILITY for name, value in probabilities.items() if name not in (UNKNOWN, NO_GAP))


def format_score(score: dict[str, Any]) -> str:
    """Format a score as text: some summary lines, the score of the named causes, and one line for each fault."""

    def show(value: float | None, digits: int = 2) -> str:
        """Format a number; "-" for None."""
        return "-" if value is None else f"{value:.{digits}f}"

    lines = [
        f"streams {score['streams']}, without fault {score['streams_without_fault']}, "
        f"{score['fault_free_hours']:.1f} hours without fault",
        f"false alarms {score['false_alarms']}: {show(score['false_alarms_per_24h'])} per 24 h, "
        f"upper bound (95 %) {show(score['false_alarms_per_24h_upper_95'])}",
        f"faults {score['faults']}, detected {show(score['detected_share'])}, "
        f"median delay {show(score['median_delay_contacts'], 0)} contacts, located {show(score['located_share'])}",
    ]
    for count, one in score["naming"].items():
        lines.append(
            f"after {count} contacts: true cause first {show(one['first_share'])} of {one['known']}, unknown reported "
            f"{show(one['reported_unknown_share'])} of {one['unknown']}, wrong at 0.8 {show(one['wrong_share'])}"
        )
    for one in score["each"]:
        place = one["found_place"] or {}
        lines.append(
            f"  {one['number']:3d} {one['cause']:20s} {one['lines'][0][:44]:44s} "
            f"{'-' if one['delay_contacts'] is None else one['delay_contacts']!s:>4s} "
            f"{one['quantity'] or '-':9s} {place.get('level', '-'):6s} {place.get('sensor', '')}"
        )
    return "\n".join(lines)
