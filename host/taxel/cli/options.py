"""Options that several commands share: one name and one meaning for each concept."""

from pathlib import Path
from typing import Annotated, Final

import typer

from taxel.errors import TaxelError
from taxel.hand.errors import format_value
from taxel.types import FloatArray

Url = Annotated[str, typer.Argument(help="The skin: serial:///dev/ttyUSB0, emulator:, file:RECORDING or ros:original.")]
HandOption = Annotated[
    str | None,
    typer.Option("--hand", help="Packaged hand or description file. Default: the recording's own, else original."),
]
JointAngles = Annotated[
    str | None,
    typer.Option("--joint-angles", help="Joint angles of the hand's robot in radians: 0.1,0.2,... Default: all 0."),
]
JointFile = Annotated[
    Path | None,
    typer.Option("--joint-file", help="CSV of joint angles: time_s and one column for each joint of the robot."),
]
JointTopic = Annotated[
    str | None,
    typer.Option(help="Topic of type sensor_msgs/JointState with the joint angles, instead of --joint-angles."),
]
HandCan = Annotated[
    str | None,
    typer.Option("--hand-can", help="CAN channel of the hand, whose joint angles are read: can:socketcan:can0."),
]
Seconds = Annotated[float | None, typer.Option("--seconds", min=1e-3, help="Stop after this time. Default: Ctrl-C.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of all random numbers.")]
Jobs = Annotated[int | None, typer.Option("--jobs", min=1, help="Number of processes. Default: one for each core.")]
ThresholdCounts = Annotated[
    float, typer.Option("--threshold-counts", min=0.0, help="Signal above which a taxel is active, counts.")
]
ProximityFile = Annotated[
    Path | None,
    typer.Option(
        "--proximity", help="Calibration of `taxel proximity calibrate`: also estimate targets before contact."
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing output files.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


def parse_joint_angles(text: str | None) -> FloatArray | None:
    """Parse the option `--joint-angles`, such as "0.1,0.2", to f64[j], radians; None without the option.

    Raises `TaxelError` for a text that is not a list of finite numbers.
    """
    import numpy as np

    if text is None:
        return None
    try:
        angles = np.array([float(part) for part in text.split(",")])
    except ValueError:
        angles = np.array([np.nan])
    if not np.isfinite(angles).all():
        raise TaxelError(f"--joint-angles: expected numbers in radians separated by commas, found {format_value(text)}")
    return angles


def parse_seeds(text: str, option: str) -> list[int]:
    """Parse numbers and ranges separated by commas, such as `101-110` or `101,104`; return each seed once, in order.

    option: name of the option for error messages. Raises `TaxelError` for another text, and for a range of more than
    `MAX_SEEDS` seeds.
    """
    seeds: dict[int, None] = {}
    for part in text.split(","):
        low, _, high = part.strip().partition("-")
        if not low.isdecimal() or (high and not high.isdecimal()) or part.strip().endswith("-"):
            raise TaxelError(f"{option}: expected seeds such as 101-110 or 101,104, found {format_value(text)}")
        first, last = int(low), int(high or low)
        if last < first or last - first >= MAX_SEEDS:
            raise TaxelError(
                f"{option}: expected a range of up to {MAX_SEEDS} rising seeds, found {format_value(part)}"
            )
        seeds |= dict.fromkeys(range(first, last + 1))
    return list(seeds)


MAX_SEEDS: Final = 1000
"""Largest length of a range of seeds; a longer one is a mistake, since each seed takes minutes."""
