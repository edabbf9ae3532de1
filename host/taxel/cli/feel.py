"""`taxel feel`: presses on the emulated skin, and measured touches sent through it."""

import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from taxel.demonstration import DEMO_PRESSES, PressOutcome, press_the_skin
from taxel.hand import load_hand
from taxel.hand.heat_map import save_heat_map
from taxel.recording import load_recording, recordings
from taxel.recording.replay import replay_touches


def feel(
    out: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path("out/feel"),
    seed: Annotated[int, typer.Option(help="Seed of the emulated world.")] = 1,
    seconds: Annotated[float, typer.Option(help="Seconds of each measured recording to send through the skin.")] = 60.0,
) -> None:
    """Boot the emulated 17-board skin, press on it, show the activated taxels; then send measured touches the same way.

    Example: taxel feel --seconds 10 --out out/feel
    """
    console = Console()
    out.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    _presses(console, out, seed)
    _measured(console, out, seconds)
    console.print(
        f"[bold]done in {time.monotonic() - began:.1f} s[/bold]; pictures: {out}/skin.png, {out}/measured.png"
    )


def _presses(console: Console, out: Path, seed: int) -> None:
    hand = load_hand("allegro")
    console.print(
        f"[bold]1. The emulated skin[/bold]: {len(hand.boards)} boards, {hand.n_taxels} taxels, "
        f"{len(DEMO_PRESSES)} presses"
    )
    columns = (
        TextColumn("{task.description:<22}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console) as progress:
        tasks: dict[str, int] = {}

        def advance(step: str, fraction: float) -> None:
            if step not in tasks:
                tasks[step] = progress.add_task(step, total=1.0)
            progress.update(tasks[step], completed=fraction)  # type: ignore[arg-type]

        result = press_the_skin(hand, seed, advance)
    console.print(
        f"hub firmware {result.firmware}, protocol version {result.protocol_version}; "
        f"{result.boards_found} boards found, {result.boards_missing} missing; "
        f"{result.rate_hz:.2f} scans a second at 400 kHz I2C"
    )
    console.print(
        f"baseline over 100 samples: mean {result.baseline_mean:.0f} counts, noise {result.baseline_noise:.2f} counts, "
        f"{result.disturbed} taxels disturbed"
    )
    console.print(_press_table(result.presses))
    losses = result.losses
    console.print(
        f"frames: {losses.frames_sent} sent = {losses.received} received + {losses.lost_on_wire} lost; "
        f"active outside every press: {result.false_activations}"
    )
    save_heat_map(
        hand,
        result.largest_signal,
        result.ever_active,
        out / "skin.png",
        "Emulated skin: largest signal during the presses",
    )


def _press_table(presses: list[PressOutcome]) -> Table:
    table = Table(title="presses")
    for heading in ("board", "probe", "felt after", "active", "signal"):
        table.add_column(heading, justify="left" if heading in {"board", "probe"} else "right", no_wrap=True)
    for outcome in presses:
        press = outcome.press
        felt = "not felt" if outcome.delay_s is None else f"{1e3 * outcome.delay_s:.0f} ms"
        table.add_row(
            press.board, f"{press.force_n:g} N, {1e3 * press.diameter_m:g} mm", felt,
            str(len(outcome.active_taxels)), f"{outcome.largest_signal:.0f} counts",
        )  # fmt: skip
    return table


def _measured(console: Console, out: Path, seconds: float) -> None:
    hand = load_hand("allegro")
    console.print(
        f"[bold]2. Measured touches[/bold] (CapFingerId recordings, MIT licence), {seconds:g} s each, "
        "through the same path"
    )
    for name in recordings():
        with tempfile.TemporaryDirectory(prefix="taxel-") as folder, console.status(f"replaying {name}"):
            score = replay_touches(load_recording(name), hand, seconds=seconds, folder=Path(folder))
        console.print(f"{name}: {score}")
    title = f"Measured touch on the skin ({name})"
    save_heat_map(hand, score.map_signal, score.map_active, out / "measured.png", title)
