"""`taxel show`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel.campaign.pictures import save_clouds, save_grasp
from taxel.cli.outcome_lines import print_outcomes
from taxel.errors import TaxelError
from taxel.recording.general.dataset import GeneralDataset, read_version
from taxel.recording.general.format import VERSION as GENERAL_VERSION
from taxel.recording.general.pictures import save_maps
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import SIM
from taxel.recording.grasp_invariants import InvariantChecker

MAX_LINES = 20
"""Largest number of listed violations of one dataset."""


def show(
    datasets: Annotated[list[Path], typer.Argument(help="Grasp datasets, such as real.h5 sim.h5.")],
    out: Annotated[Path, typer.Option(help="Folder for clouds.png and grasp.png, or maps.png (version 2).")] = Path(
        "out/show"
    ),
    grasp: Annotated[
        str | None,
        typer.Option(help="Id of the grasp to draw. Default: one of an object and approach in all datasets."),
    ] = None,
    check: Annotated[
        bool,
        typer.Option(
            "--check", help="Draw nothing; list frames of simulated datasets that violate physical invariants."
        ),
    ] = False,
) -> None:
    """Draw a grasp dataset, or check the physics of a simulated one.

    One picture shows the accumulated contact points of each object, the other the active and inactive taxels of a
    grasp; one line for each object states the failed grasps of a campaign. With --check, the exit status is 1 if a
    frame violates an invariant: force without contact, an object deeper in the skin than the layer is thick, a jump of
    the total force, a contradiction to the force law, or a hold in which the force still changes.

    Example: taxel show out/campaign/real.h5 out/campaign/sim.h5 --out out/show
    """
    console = Console(markup=False)
    if any(read_version(path) == GENERAL_VERSION for path in datasets):
        raise typer.Exit(_show_general(datasets, out, check, console))
    if check:
        raise typer.Exit(_check_physics(datasets, console))
    grasps = _choose_grasps(datasets) if grasp is None else [grasp] * len(datasets)
    out.mkdir(parents=True, exist_ok=True)
    with console.status("drawing"):
        save_clouds(datasets, out / "clouds.png")
        save_grasp(datasets, out / "grasp.png", grasps)
    print_outcomes(console, datasets)
    console.print(f"pictures: {out / 'clouds.png'}, {out / 'grasp.png'}")


def _show_general(paths: list[Path], out: Path, check: bool, console: Console) -> int:
    """Print the sizes of version 2 datasets and draw their maps to the folder `out`; return the exit status 0.

    check: whether --check is given; then a line states that there is nothing to check, and nothing is drawn.
    """
    for path in paths:
        with GeneralDataset(path) as data:
            sessions = len({contact.session for contact in data})
            taxels = f"{data.n} taxels{' of 3 components' if data.is_vector else ''}"
            days = "1 session" if sessions == 1 else f"{sessions} sessions"
            text = f"{path}: {data.header.source}, {taxels}, {len(data)} contacts in {days}"
            console.print(text, soft_wrap=True)
            if check:
                console.print(f"{path}: version 2 has no contact forces to check", soft_wrap=True)
    if not check:
        out.mkdir(parents=True, exist_ok=True)
        with console.status("drawing"):
            save_maps(paths, out / "maps.png")
        console.print(f"pictures: {out / 'maps.png'}", highlight=False)
    return 0


def _check_physics(paths: list[Path], console: Console) -> int:
    """Print the violated physical invariants of simulated datasets, and a summary line for each.

    Returns the exit status: 1 if an invariant is violated, else 0. A measured dataset has no contact forces and gives
    only a line that states this.
    """
    status = 0
    for path in paths:
        with GraspDataset(path) as data:
            if data.source != SIM:
                console.print(f"{path}: source {data.source!r} has no contact forces to check", soft_wrap=True)
                continue
            violations = list(InvariantChecker(data).find_violations())
            for violation in violations[:MAX_LINES]:
                console.print(f"{path}: {violation}", soft_wrap=True)
            if len(violations) > MAX_LINES:
                console.print(f"{path}: and {len(violations) - MAX_LINES} more", soft_wrap=True)
            frames = len({(violation.grasp, violation.frame) for violation in violations})
            console.print(f"{path}: {frames} frames of {len(data)} grasps violate an invariant", soft_wrap=True)
            status = 1 if violations else status
    return status


def _choose_grasps(paths: list[Path]) -> list[str]:
    """Choose one grasp of each dataset, such that the grasps are comparable; return their ids in the order of `paths`.

    The grasps have the same id if all datasets have a common id, else the same object and approach. Raises `TaxelError`
    if no combination of object and approach is in all datasets.
    """
    ids: list[list[str]] = []
    conditions: list[dict[tuple[str, str], str]] = []
    for path in paths:
        with GraspDataset(path) as data:
            ids.append(list(data.ids))
            first: dict[tuple[str, str], str] = {}
            for grasp in data:
                first.setdefault((grasp.object, grasp.approach), grasp.id)
            conditions.append(first)
    if common := sorted(set.intersection(*map(set, ids))):
        return [common[0]] * len(paths)
    shared = sorted(set.intersection(*(set(first) for first in conditions)))
    if not shared:
        raise TaxelError(
            f"{', '.join(map(str, paths))}: expected an object and approach that all datasets contain, found none; "
            "draw the datasets one by one"
        )
    return [first[shared[0]] for first in conditions]
