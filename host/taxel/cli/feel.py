"""`taxel feel`."""

import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from taxel.cli.options import Seed
from taxel.demonstration import DEMO_CONTACTS, ContactOutcome, run_demonstration
from taxel.hand import load_hand
from taxel.hand.heat_map import save_heat_map
from taxel.optional import require_packages
from taxel.recording import list_recordings, load_recording
from taxel.recording.replay import ReplayOptions, replay_touches


def feel(
    out: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path("out/feel"),
    seed: Seed = 1,
    seconds: Annotated[float, typer.Option(min=1.0, help="Length of each measured recording, seconds.")] = 60.0,
) -> None:
    """Apply scripted contacts and measured touches to the emulated skin, and show the active taxels.

    Example: taxel feel --seconds 10 --out out/feel
    """
    require_packages("taxel feel", "plots", "matplotlib")
    console = Console()
    out.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()
    _show_scripted_contacts(console, out, seed)
    _show_measured_touches(console, out, seconds)
    console.print(
        f"[bold]done in {time.monotonic() - started:.1f} s[/bold]; pictures: {out}/skin.png, {out}/measured.png"
    )


def _show_scripted_contacts(console: Console, out: Path, seed: int) -> None:
    """Apply the scripted contacts to the emulated skin; print the response and draw it as a heat map.

    out: folder of the picture skin.png. seed: seed of the emulated skin.
    """
    hand = load_hand("original")
    console.print(
        f"[bold]1. The emulated skin[/bold]: {len(hand.boards)} boards, {hand.n_taxels} taxels, "
        f"{len(DEMO_CONTACTS)} contacts"
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
            """Show the progress of a step; a bar is added at the first call. fraction: completed share, 0 to 1."""
            if step not in tasks:
                tasks[step] = progress.add_task(step, total=1.0)
            progress.update(tasks[step], completed=fraction)  # type: ignore[arg-type]

        result = run_demonstration(hand, seed, advance)
    console.print(
        f"hub firmware {result.firmware}, protocol version {result.protocol_version}; "
        f"{result.boards_found} boards found, {result.boards_missing} missing; "
        f"{result.rate_hz:.2f} scans per second at 400 kHz I2C"
    )
    console.print(
        f"baseline over 100 samples: mean {result.baseline_mean:.0f} counts, noise {result.baseline_noise:.2f} counts, "
        f"{result.disturbed} taxels disturbed"
    )
    console.print(_make_contact_table(result.contacts))
    losses = result.losses
    console.print(
        f"frames: {losses.frames_sent} sent = {losses.frames_received} received + {losses.lost_on_wire} lost; "
        f"active without a contact: {result.false_activations}"
    )
    save_heat_map(
        hand,
        result.largest_signal,
        result.ever_active,
        out / "skin.png",
        "Emulated skin: largest signal during the contacts",
    )


def _make_contact_table(outcomes: list[ContactOutcome]) -> Table:
    """Return a table with the response of the skin to each scripted contact."""
    table = Table(title="contacts")
    for heading in ("board", "probe", "active within", "active", "signal"):
        table.add_column(heading, justify="left" if heading in {"board", "probe"} else "right", no_wrap=True)
    for outcome in outcomes:
        indentation = outcome.contact
        delay = "not active" if outcome.delay_s is None else f"{1e3 * outcome.delay_s:.0f} ms"
        table.add_row(
            indentation.board, f"{indentation.force_n:g} N, {1e3 * indentation.diameter_m:g} mm", delay,
            str(len(outcome.active_taxels)), f"{outcome.largest_signal:.0f} counts",
        )  # fmt: skip
    return table


def _show_measured_touches(console: Console, out: Path, seconds: float) -> None:
    """Replay all touch recordings through the emulated skin; print the scores, and draw the last one as a heat map.

    out: folder of the picture measured.png. seconds: replayed length of each recording.
    """
    hand = load_hand("original")
    console.print(
        f"[bold]2. Measured touches[/bold] (CapFingerId recordings, MIT licence), {seconds:g} s each, "
        "through the same path"
    )
    for name in list_recordings():
        with tempfile.TemporaryDirectory(prefix="taxel-") as folder, console.status(f"replaying {name}"):
            score = replay_touches(load_recording(name), hand, ReplayOptions(seconds=seconds), Path(folder))
        console.print(f"{name}: {score}")
    title = f"Measured touch on the skin ({name})"
    save_heat_map(hand, score.map_signal, score.map_active, out / "measured.png", title)
