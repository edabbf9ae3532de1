"""`taxel proximity`."""

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from taxel.cli.options import AsJson, HandOption, Overwrite, Seconds, Seed, Url
from taxel.errors import TaxelError
from taxel.output import open_whole_text, whole_path
from taxel.proximity import (
    ProximityCalibration,
    ProximityError,
    ProximityEstimate,
    calibrate,
    collect_holds,
    format_calibration,
    format_holds,
    open_watch,
    read_calibration,
    read_holds,
)
from taxel.proximity.calibration_merge import merge_calibrations
from taxel.proximity.estimator import BASELINE_FRAMES
from taxel.proximity.hold_signals import HoldCounts
from taxel.proximity.holds import MAX_DISTANCE_M, TARGET_NAME
from taxel.proximity.live_holds import take_hold
from taxel.proximity.watch import HORIZON_S, WARNING_PROBABILITY
from taxel.skin import Skin, open_skin
from taxel.stream.frame_stream import has_arrivals

proximity_app = typer.Typer(
    no_args_is_help=True, help="Estimate distance and speed of a target before it touches the skin."
)

CalibrationFile = Annotated[Path, typer.Option("--calibration", help="File of `taxel proximity calibrate`.")]
DEFAULT_TARGET = "grounded"
DEFAULT_DISTANCES = "14,10,8,6,4.5,3.5,2.5,2,1.5,1,0.5"


@proximity_app.command("calibrate")
def calibrate_command(
    url: Url,
    out: Annotated[Path, typer.Option(help="Calibration file to write (JSON).")],
    holds: Annotated[
        Path | None,
        typer.Option(help="CSV of the holds of a recording: start_s,end_s,board,target,distance_mm. Default: ask."),
    ] = None,
    boards: Annotated[
        str | None,
        typer.Option("--boards", help="Boards to calibrate, such as palm,fingertip_index. Default: one of each kind."),
    ] = None,
    target: Annotated[
        str | None, typer.Option(help=f"Name of the target that is held. Default: {DEFAULT_TARGET}.")
    ] = None,
    distances_mm: Annotated[
        str | None, typer.Option(help=f"Distances of the holds, millimetres. Default: {DEFAULT_DISTANCES}.")
    ] = None,
    hold_seconds: Annotated[float, typer.Option(min=0.5, max=60.0, help="Duration of a hold.")] = 3.0,
    merge: Annotated[Path | None, typer.Option(help="Add kinds and targets of this calibration file.")] = None,
    hand: HandOption = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Calibrate the response of the skin to a target that is held at known distances.

    With --holds the signals are read from a recording whose intervals are known. Otherwise the command states each
    distance, waits for Enter, and takes the frames of the skin. One board of each kind is sufficient.

    Example: taxel proximity calibrate file:plate.bin --holds plate.csv --out skin.json
    """
    if holds is not None:
        given = (("--boards", boards), ("--target", target), ("--distances-mm", distances_mm))
        for option, value in given:
            if value is not None:
                raise ProximityError(f"{option}: {holds} states boards, targets and distances; leave out {option}")
    # The output is opened first: a folder without permission must not be noticed only after half an hour of holds.
    with open_whole_text(out, overwrite=overwrite) as file, open_skin(url, hand) as skin:
        earlier = None if merge is None else read_calibration(merge, skin.hand)
        if holds is not None:
            counts = collect_holds(skin, skin.hand, read_holds(holds, skin.hand))
        else:
            counts = _take_holds(
                skin,
                _parse_boards(skin, boards or ""),
                target or DEFAULT_TARGET,
                _parse_distances(distances_mm or DEFAULT_DISTANCES),
                hold_seconds,
            )
        result = calibrate(skin.hand, counts)
        if earlier is not None:
            result = merge_calibrations(earlier, result)
        file.write(format_calibration(result))
    _print_calibration(result, out, as_json)


def _parse_boards(skin: Skin, text: str) -> list[str]:
    """Return the names of the boards in the option --boards; "": the first board of each kind of the hand.

    Raises UnknownBoardError for a board that the hand does not have.
    """
    if text:
        return [skin.hand.find_board(name.strip()).name for name in text.split(",")]
    # In reverse order, the first board of a kind is the last to be stored under the name of the kind.
    return list({board.kind.name: board.name for board in reversed(skin.hand.boards)}.values())[::-1]


def _parse_distances(text: str) -> list[float]:
    """Parse the option --distances-mm, millimetres separated by commas; return metres.

    Raises `ProximityError` for another text, and for a distance of 0 or above `MAX_DISTANCE_M`.
    """
    try:
        values = [1e-3 * float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if not values or not all(0.0 < value <= MAX_DISTANCE_M for value in values):
        raise ProximityError(
            f"--distances-mm: expected numbers above 0, at most {1e3 * MAX_DISTANCE_M:g}, separated by commas, "
            f"found '{text}'"
        )
    return values


def _take_holds(
    skin: Skin, boards: Sequence[str], target: str, distances: Sequence[float], seconds: float
) -> list[HoldCounts]:
    """Request each hold of the target on the terminal, and return the counts of each hold.

    A hold is an interval in which the target is held at one distance from a board. Each board has a hold without target
    before and after those at the `distances`, metres; it lasts at least 6 s. target: name of the target. seconds:
    duration of a hold. Raises `ProximityError` for a recording and a wrong name.
    """
    if skin.link.is_recorded:
        raise ProximityError(f"{skin.link.name}: a recording needs --holds, the intervals at which the target was held")
    if not TARGET_NAME.fullmatch(target):
        raise ProximityError(f"--target: expected a name of lower-case letters, digits and _, found '{target}'")
    counts = []
    for name in boards:
        board = (skin.hand.find_board(name).address, name)
        held_distances: list[float | None] = [None, *distances, None]  # None: without target
        for distance in held_distances:
            place = "Remove everything near" if distance is None else f"Hold the target {1e3 * distance:g} mm from"
            typer.prompt(f"{place} board {name}, then press Enter", default="", show_default=False)
            counts.append(
                take_hold(skin.poll, board, (target, distance), max(seconds, 6.0) if distance is None else seconds)
            )
    return counts


def _print_calibration(calibration: ProximityCalibration, path: Path, as_json: bool) -> None:
    """Print a table with the fitted response of each board kind to each target, or its values as JSON.

    path: calibration file that was written. In the JSON values, gain_spread is the relative standard deviation of the
    taxels' gains, and curve_error that of the fitted curve between its support points.
    """
    rows = [
        {
            "kind": name,
            "target": target,
            "distances": len(response.curve.distance_m),
            "signal_counts": [round(float(value), 2) for value in response.curve.signal_counts],
            "distance_mm": [round(1e3 * float(value), 4) for value in response.curve.distance_m],
            "gain_spread": round(response.gain_spread, 4),
            "curve_error": round(response.curve_error, 4),
            "noise_counts": round(kind.noise_counts, 3),
        }
        for name, kind in calibration.kinds.items()
        for target, response in kind.targets.items()
    ]
    if as_json:
        print(json.dumps({"file": str(path), "responses": rows}))
        return
    table = Table("kind", "target", "distances", "nearest", "spread", "noise")
    for row in rows:
        signals = row["signal_counts"]
        nearest = signals[0] if isinstance(signals, list) else 0.0
        spread = row["gain_spread"]
        percent = 100 * spread if isinstance(spread, float) else 0.0
        values = row["kind"], row["target"], row["distances"], f"{nearest:.0f}", f"{percent:.1f} %", row["noise_counts"]
        table.add_row(*(str(value) for value in values))
    console = Console(markup=False)
    console.print(table)
    console.print(
        "nearest: signal at the smallest distance, counts; spread: between taxels; noise: counts", soft_wrap=True
    )
    console.print(f"written: {path}", soft_wrap=True, highlight=False)


@proximity_app.command("watch")
def watch_command(
    url: Url,
    calibration: CalibrationFile,
    hand: HandOption = None,
    horizon_ms: Annotated[
        float, typer.Option(min=10.0, max=1000.0, help="Time within which a contact is predicted, milliseconds.")
    ] = 1e3 * HORIZON_S,
    seconds: Seconds = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object for each frame with a target.")
    ] = False,
) -> None:
    """Print distance, speed, time to contact and kind of targets in front of the boards.

    Nothing may be near the skin during the first 40 frames of each board. A line is printed when a target appears, then
    ten times a second, and when a contact is predicted. With --json, every estimate with a target is one line.

    Example: taxel proximity watch serial:///dev/ttyUSB0 --calibration skin.json
    """
    try:
        with open_skin(url, hand) as skin:
            _print_estimates(skin, calibration, 1e-3 * horizon_ms, seconds, as_json)
    except KeyboardInterrupt:
        return  # Ctrl-C is the usual end


def _print_estimates(skin: Skin, calibration: Path, horizon_s: float, seconds: float | None, as_json: bool) -> None:
    """Print the estimates with a target or contact until the stream of the skin ends, or for `seconds` of its clock.

    An estimate is printed if a target is present, or in contact, with a probability above 0.5. calibration: calibration
    file. horizon_s: time within which a contact is predicted, seconds. Raises TaxelError if no board completed its
    baseline.
    """
    estimators = open_watch(calibration, skin.hand, horizon_s)
    is_live = skin.link.is_real_time and has_arrivals(skin.link)
    first_s: float | None = None
    printed: dict[int, tuple[float, bool]] = {}
    is_ready = False
    for frame in skin:
        first_s = frame.time_s if first_s is None else first_s
        estimate = estimators.take(frame, time.monotonic() if is_live else None)
        if not is_ready and estimators.progress >= 1.0:
            is_ready = True
            if not as_json:
                print(f"baseline complete after {frame.time_s - first_s:.1f} s", flush=True)
        if estimate is not None and (estimate.present > 0.5 or estimate.contact > 0.5):
            _print_estimate(estimate, printed, as_json)
        if seconds is not None and frame.time_s - first_s >= seconds:
            break
    if not is_ready:
        problem = f"no board completed its baseline of {BASELINE_FRAMES} frames"
        raise TaxelError(f"{skin.link.name}: {problem}; check board and hand")


def _print_estimate(estimate: ProximityEstimate, printed: dict[int, tuple[float, bool]], as_json: bool) -> None:
    """Print an estimate as JSON, or as text if its board's last line is 0.1 s old or a contact is newly predicted.

    printed: (time in seconds, whether a contact was predicted) of the last line by board address; updated.
    """
    if as_json:
        print(json.dumps(estimate.as_dict()), flush=True)
        return
    warns = estimate.contact_soon > WARNING_PROBABILITY
    last_s, warned = printed.get(estimate.address, (float("-inf"), False))
    if estimate.time_s - last_s >= 0.1 or (warns and not warned):
        printed[estimate.address] = (estimate.time_s, warns)
        print(format_estimate(estimate), flush=True)


def format_estimate(estimate: ProximityEstimate) -> str:
    """Format an estimate as one line: time, board, distance, speed, time to contact and target.

    Distance and speed are a median with an interval. Without distance or speed, the line states only a contact or the
    probability of a target.
    """
    head = f"{estimate.time_s:9.3f} s  {estimate.board:22s}"
    distance, speed, remaining = estimate.distance_m, estimate.speed_m_s, estimate.time_to_contact_s
    if distance is None or speed is None:
        state = "contact" if estimate.contact > 0.5 else f"target possible ({100 * estimate.present:.0f} %)"
        return f"{head} {state}"
    parts = [
        f"{1e3 * distance.median:5.2f} mm [{1e3 * distance.low:.2f}, {1e3 * distance.high:.2f}]",
        f"{1e3 * speed.median:+.0f} mm/s [{1e3 * speed.low:+.0f}, {1e3 * speed.high:+.0f}]",
        f"target {estimate.target}",
    ]
    if remaining is not None:
        parts.insert(2, f"contact in {remaining.median:.2f} s")
    if estimate.contact_soon > WARNING_PROBABILITY:
        parts.append(f"CONTACT within {1e3 * estimate.horizon_s:.0f} ms: {100 * estimate.contact_soon:.0f} %")
    return f"{head} " + ", ".join(parts)


@proximity_app.command("emulate")
def emulate_command(
    out: Annotated[Path, typer.Option(help="Folder for the recording (plate.bin) and its holds (plate.csv).")],
    target: Annotated[str, typer.Option(help="Target: grounded (metal plate at ground) or acrylic.")] = "grounded",
    boards: Annotated[str, typer.Option("--boards", help="Boards in front of which the plate is held.")] = "palm",
    hand: HandOption = None,
    seed: Seed = 1,
    overwrite: Overwrite = False,
) -> None:
    """Record an emulated calibration session: a plate is held at known distances in front of boards.

    Example: taxel proximity emulate --out stage
    """
    from taxel.emulated.calibration_stage import EFFECTS, record_calibration
    from taxel.hand import load_hand
    from taxel.hand.world import WorldSettings

    if target not in EFFECTS:
        raise ProximityError(f"--target: expected {' or '.join(EFFECTS)}, found '{target}'")
    description = load_hand(hand or "original")
    names = [description.find_board(name.strip()).name for name in boards.split(",")]
    capture, table = out / "plate.bin", out / "plate.csv"
    settings = WorldSettings(seed=seed, effects=[EFFECTS[target]])
    # Both files appear at the end, so that a recording never stands beside the holds of another one.
    with open_whole_text(table, overwrite=overwrite) as file, whole_path(capture, overwrite=overwrite) as part:
        holds = record_calibration(part, description, names, target, settings)
        file.write(format_holds(holds))
    print(f"written: {capture} ({holds[-1].end_s:.0f} s), {table} ({len(holds)} holds)")
