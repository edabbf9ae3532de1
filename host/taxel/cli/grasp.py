"""The command `taxel grasp`."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from taxel.campaign.emulated import run_emulated
from taxel.campaign.outcomes import count_outcomes
from taxel.campaign.point_counts import PointCount, count_contact_points
from taxel.campaign.settings import EmulatedSettings, parse_effects
from taxel.campaign.setup import Setup
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.cli.options import AsJson, Jobs, Overwrite, Seed
from taxel.cli.outcome_lines import print_outcomes
from taxel.cli.progress import count_bar
from taxel.errors import TaxelError
from taxel.grasp.calibration import load_calibration
from taxel.grasp.plan import PlannedGrasp, make_thesis_plan
from taxel.hand import load_hand
from taxel.sim.original_sensing import PALM_TIPS_M
from taxel.sim.sensing import GRASP_LEVELS, Level, Sensing

SOURCES = ("emulated", "sim", "physical", "both")


def grasp(
    source: Annotated[
        str, typer.Option(help=f"{', '.join(SOURCES)}. both: real.h5 (emulated) and sim.h5 in the folder --out.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="Dataset to write; a folder for --source both. Required, except with --check-motion."),
    ] = None,
    seed: Seed = 1,
    sessions: Annotated[int, typer.Option(help="Number of sessions over which the grasps are distributed.")] = 6,
    grasps: Annotated[int | None, typer.Option(min=1, help="Number of grasps. Default: all 144.")] = None,
    objects: Annotated[
        list[str] | None, typer.Option("--object", help="Only grasps of this object; repeatable. Default: all objects.")
    ] = None,
    effects: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            help="Emulated: effect line such as 'spread film length_m=0.002', or thesis; repeatable. Default: thesis.",
        ),
    ] = None,
    no_effects: Annotated[
        bool, typer.Option("--no-effects", help="Emulated: a skin without effects, except the read-out noise.")
    ] = False,
    sensing: Annotated[
        str,
        typer.Option(
            help=f"Sensor model of the simulator: {', '.join(GRASP_LEVELS)}. original: the contact plug-in of the "
            "original simulator, on the hand original."
        ),
    ] = "layer",
    hand: Annotated[str, typer.Option(help="Packaged hand or description file: original, or allegro.")] = "original",
    calibration: Annotated[Path | None, typer.Option(help="TOML file with the measured poses of the objects.")] = None,
    skin: Annotated[str, typer.Option(help="Physical: URL of the skin.")] = "serial:///dev/ttyUSB0",
    can: Annotated[str, typer.Option(help="Physical: CAN channel of the hand.")] = "can:socketcan:can0",
    arm: Annotated[str, typer.Option(help="Physical: rtde:HOST or simulated.")] = "rtde:192.168.0.100",
    check_motion: Annotated[
        bool,
        typer.Option(
            "--check-motion",
            help="Physical: plan the motions of arm and hand without hardware, print them, and write no dataset.",
        ),
    ] = False,
    arm_start: Annotated[
        str | None,
        typer.Option(
            help="With --check-motion: six start angles of the arm, degrees. Default: 0,-90,0,-90,0,0 (upright)."
        ),
    ] = None,
    jobs: Jobs = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted campaign.")] = False,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Run the 144 grasps of the thesis on the emulated hand, in the simulator or on a physical hand.

    The result is a grasp dataset: raw counts, times, phases, joint angles and poses. On the emulated hand and in the
    simulator, a grasp that fails by chance (object lost, toppled, turned to another approach, or moving in the hold) is
    repeated with another variation, at most twice. The dataset marks failed grasps, and the output counts them.

    Examples: taxel grasp --source both --out out/campaign; taxel grasp --source sim --grasps 10 --out sim.h5; taxel
    grasp --source physical --check-motion
    """
    plan = _select_plan(seed, sessions, grasps, objects or ())
    level = _parse_level(sensing)
    setup = _make_setup(hand, calibration, level, source)
    emulated = EmulatedSettings(seed=seed, effects=_parse_effects(effects or (), no_effects))
    sim = SimSettings(seed=seed, sensing=Sensing(level))
    console = Console(stderr=as_json, markup=False)
    if check_motion or arm_start is not None:
        from taxel.cli.grasp_motion import check_motions  # needs the extra `hand`

        check_motions(setup, plan, source, check_motion, arm_start, as_json)
        return
    if out is None:
        raise TaxelError("--out: expected the dataset to write, found none; give --out FILE")
    paths = _choose_output_files(source, out, overwrite or resume)
    if "emulated" in paths:
        path = paths["emulated"]
        with count_bar(console, f"emulated hand to {path}", "grasps") as show:
            run_emulated(path, plan, emulated, setup, jobs, overwrite, resume, show)
    if "sim" in paths:
        path = paths["sim"]
        with count_bar(console, f"simulator to {path}", "grasps") as show:
            run_simulated(path, plan, sim, setup, jobs, overwrite, resume, show)
    if "physical" in paths:
        path = paths["physical"]
        from taxel.campaign.physical import PhysicalSettings, run_physical  # these two need the extra `hand`
        from taxel.cli.workstation import open_workstation

        settings = PhysicalSettings(confirm_placement=_wait_for_operator)
        with (
            open_workstation(arm, can, skin, setup.hand) as workstation,
            count_bar(console, f"hand to {path}", "grasps") as show,
        ):
            run_physical(path, plan, workstation, settings, setup, overwrite, resume, show)
    _print_contact_points(console, list(paths.values()), as_json)
    if not as_json:
        print_outcomes(console, paths.values())


def _make_setup(hand: str, calibration: Path | None, level: Level, source: str) -> Setup:
    """Return the setup of a campaign: hand and poses of the objects.

    hand: packaged hand or description file. calibration: file with the measured poses of the objects. level: sensor
    model of the simulator. The level "original" always uses the original hand, whose palm has rigid tips of the height
    `PALM_TIPS_M` in place of the elastic layer. Raises `TaxelError` for the level "original" with a source other than
    the simulator.
    """
    poses = load_calibration(calibration) if calibration is not None else None
    if level != "original":
        return Setup(load_hand(hand), calibration=poses)
    if source != "sim":
        raise TaxelError(f"--sensing original: expected --source sim, found --source {source}")
    original = replace(load_hand("original"), layer_m=PALM_TIPS_M)
    return Setup(hand=original, calibration=poses, torques="simulation")


def _choose_output_files(source: str, out: Path, may_exist: bool) -> dict[str, Path]:
    """Choose the dataset files to write, by source ("emulated", "sim", "physical").

    For the source "both", `out` is a folder, which is created. may_exist: existing files are continued or replaced.
    Raises `TaxelError` for an unknown source, and for an existing file unless `may_exist`.
    """
    if source not in SOURCES:
        raise TaxelError(f"--source: expected {', '.join(SOURCES)}, found '{source}'")
    if source != "both":
        paths = {source: out}
    else:
        paths = {"emulated": out / "real.h5", "sim": out / "sim.h5"}
    for path in paths.values():
        if path.exists() and not may_exist:
            raise TaxelError(f"{path}: exists already; choose another --out, or give --resume or --overwrite")
    if source == "both":
        out.mkdir(parents=True, exist_ok=True)
    return paths


def _select_plan(seed: int, sessions: int, grasps: int | None, objects: Sequence[str]) -> tuple[PlannedGrasp, ...]:
    """Plan the grasps of the thesis, and return the first `grasps` of those with the given objects.

    seed: seed of the order of grasps. sessions: number of sessions. grasps: largest number of grasps; None: all.
    objects: names of objects; empty: all. Raises `TaxelError` for a wrong option.
    """
    try:
        plan = make_thesis_plan(seed, sessions)
    except ValueError as error:
        raise TaxelError(f"--{error}") from None
    names = sorted({planned.object for planned in plan})
    for name in objects:
        if name not in names:
            raise TaxelError(f"--object: expected one of {', '.join(names)}, found '{name}'")
    plan = tuple(planned for planned in plan if not objects or planned.object in objects)
    return plan[:grasps]


def _parse_effects(texts: Sequence[str], no_effects: bool) -> list[str]:
    """Return the emulator's effect lines for the options `--effect` and `--no-effects`.

    texts: values of --effect; empty: the effects of the thesis. Raises `TaxelError` for both options together.
    """
    if "none" in texts:
        raise TaxelError("--effect none: this value is now the option --no-effects")
    if no_effects and texts:
        raise TaxelError("--effect and --no-effects: expected at most one of them, found both")
    if no_effects:
        return []
    return [line for text in texts or ("thesis",) for line in parse_effects(text)]


def _parse_level(name: str) -> Level:
    """Return the simulator's sensing level with this name. Raises `TaxelError` for an unknown name."""
    for level in GRASP_LEVELS:
        if level == name:
            return level
    raise TaxelError(f"--sensing: expected {', '.join(GRASP_LEVELS)}, found '{name}'")


def _wait_for_operator(planned: PlannedGrasp) -> None:
    """Prompt the operator to place the object of a planned grasp, and wait for Enter."""
    typer.prompt(
        f"session {planned.session}: put the {planned.object} in its position, then press Enter",
        default="",
        show_default=False,
    )


def _describe_counts(path: str, counts: Mapping[str, PointCount]) -> dict[str, dict[str, object]]:
    """Return the counts of a dataset as JSON values, by object.

    counts: numbers of grasps and contact points by object. Where the dataset contains outcomes, the failed and repeated
    grasps are added. path: file of the dataset.
    """
    content: dict[str, dict[str, object]] = {name: dict(vars(count)) for name, count in counts.items()}
    for name, outcome in count_outcomes(path).items():
        content[name] |= {"failed": outcome.failed, "failures": outcome.failures, "repeated": outcome.repeated}
    return content


def _print_contact_points(console: Console, paths: list[Path], as_json: bool) -> None:
    """Print the numbers of grasps and contact points for each object of each dataset; as JSON also the outcomes."""
    counts_by_file = {str(path): count_contact_points(path) for path in paths}
    if as_json:
        print(json.dumps({path: _describe_counts(path, by_object) for path, by_object in counts_by_file.items()}))
        return
    table = Table(title="contact points (front of the hand without the middle and pinkie fingertips, as in Table 5.2)")
    for heading in ("file", "object", "grasps", "points", "points per grasp"):
        table.add_column(heading, justify="left" if heading in {"file", "object"} else "right")
    for path, by_object in counts_by_file.items():
        for name, count in by_object.items():
            table.add_row(
                path, name, str(count.grasps), str(count.points), f"{count.points / max(count.grasps, 1):.1f}"
            )
    console.print(table)
