"""`taxel monitor`."""

import json
import time
from contextlib import AbstractContextManager, nullcontext
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli.options import HandOption, ProximityFile, Seconds, ThresholdCounts, Url
from taxel.errors import TaxelError
from taxel.monitor import LineView, OnceView, Screen, SkinMonitor, TerminalView, open_paced, watch
from taxel.monitor.demo_skin import DEMO_BASELINE_FRAMES, DEMO_URL, open_demo
from taxel.monitor.summary_text import format_line
from taxel.proximity import open_watch
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, BASELINE_SAMPLES
from taxel.skin import Skin

LINES_HZ = 1.0
"""Lines per second if the output is not a terminal."""


class NoFrameError(TaxelError):
    """No frame of the skin arrived before the time limit."""


def monitor(
    url: Url,
    web: Annotated[bool, typer.Option("--web", help="Show the hand in 3-D in a browser (extra web).")] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page on 127.0.0.1. 0: a free port.")] = 8080,
    control: Annotated[
        bool, typer.Option("--control", help="The page may take the baseline again. Default: it only shows.")
    ] = False,
    hand: HandOption = None,
    rate_hz: Annotated[float | None, typer.Option(help="Scans per second. Default: the rate of the bus.")] = None,
    speed: Annotated[float, typer.Option(help="Speed of a recording, times real time.")] = 1.0,
    baseline_frames: Annotated[
        int | None,
        typer.Option(
            min=2,
            max=10000,
            help=f"Number of frames of each board in the baseline. Default: {BASELINE_SAMPLES}; with demo: "
            f"{DEMO_BASELINE_FRAMES}.",
        ),
    ] = None,
    track_baseline: Annotated[
        bool,
        typer.Option(
            "--track-baseline", help="The baseline follows drift, and holds under contact. Default: a fixed mean."
        ),
    ] = False,
    threshold_counts: ThresholdCounts = ACTIVATION_THRESHOLD_COUNTS,
    proximity: ProximityFile = None,
    seconds: Seconds = None,
    once: Annotated[
        bool, typer.Option("--once", help="Print one view after the baseline is complete, and exit.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one line of JSON per second.")] = False,
) -> None:
    """Show a skin live, in the terminal or in a browser.

    The view shows the boards as heat maps, rates, errors and active taxels. The URL demo: shows contacts that move over
    an emulated hand. Nothing may touch the skin while the baseline is taken. Keys: q or Ctrl-C quits, b takes the
    baseline again, t shows the table of boards. If the output is not a terminal, one line per second is printed.

    Example: taxel monitor demo: --seconds 4
    """
    console = Console(markup=False)
    with _opening_status(console, url):
        frames = baseline_frames or (DEMO_BASELINE_FRAMES if url == DEMO_URL else BASELINE_SAMPLES)
        skin = open_demo(hand, rate_hz, frames) if url == DEMO_URL else open_paced(url, hand, rate_hz, speed)
    with skin:
        estimators = None if proximity is None else open_watch(proximity, skin.hand)
        model = SkinMonitor(skin, frames, threshold_counts, estimators, track_baseline)
        title = f"{url} · hand {skin.hand.name}"
        try:
            if web:
                _show_in_browser(skin, model, title, port, control, seconds)
            elif once:
                _print_once(skin, model, console, title, as_json, seconds)
            elif as_json or not console.is_terminal:
                watch(skin, model, LineView(lambda text: print(text, flush=True), as_json), seconds, LINES_HZ)
            else:
                _show_on_terminal(skin, model, console, title, seconds)
        except KeyboardInterrupt:
            return  # Ctrl-C is the usual end


def _opening_status(console: Console, url: str) -> AbstractContextManager[object]:
    """Return a context manager that shows a message on a terminal while the hub at `url` is opened."""
    return console.status(f"opening {url}: waiting for the hub") if console.is_terminal else nullcontext()


def _show_on_terminal(skin: Skin, model: SkinMonitor, console: Console, title: str, seconds: float | None) -> None:
    """Show the live skin in the terminal until its end or for `seconds`; then print one line with the last reading."""
    view = TerminalView(console, model, title)
    try:
        with view:
            watch(skin, model, view, seconds)
    finally:
        if view.last is not None:
            console.print(format_line(view.last), soft_wrap=True, highlight=False)


def _print_once(
    skin: Skin, model: SkinMonitor, console: Console, title: str, as_json: bool, seconds: float | None
) -> None:
    """Print one view of the skin after the baseline is complete. Raises `NoFrameError` if no frame arrived.

    seconds: time limit; None: no limit.
    """
    reading = watch(skin, model, OnceView(), seconds)
    if as_json:
        print(json.dumps(reading.as_dict()))
    elif console.is_terminal:
        width, height = console.size
        has_colour = console.color_system is not None and not console.no_color
        screen = Screen(skin.hand, title, model.threshold)
        console.print(screen.draw(reading, width, height - 1, has_colour), soft_wrap=True)
    else:
        print(format_line(reading))
    if not reading.frames:
        raise NoFrameError(f"{skin.link.name}: no frame arrived; {reading.advice}")


def _show_in_browser(
    skin: Skin, model: SkinMonitor, title: str, port: int, has_control: bool, seconds: float | None
) -> None:
    """Serve a page that shows the live skin in a browser, until Ctrl-C or for `seconds`; None: no time limit.

    After the end of a recording the page stays available if there is no time limit. port: port of the page on
    127.0.0.1. has_control: the page can take the baseline again.
    """
    from taxel.monitor.web import WebView

    with WebView(model, title, port, has_control) as view:
        print(f"the skin is at {view.url} (press Ctrl-C to quit)", flush=True)
        try:
            reading = watch(skin, model, view, seconds)
            print(format_line(reading), flush=True)
            while reading.is_ended and seconds is None:  # the last view of a recording stays visible
                time.sleep(0.2)
        finally:
            if view.refusals.total:
                print(f"page: {view.refusals.summary}", flush=True)
