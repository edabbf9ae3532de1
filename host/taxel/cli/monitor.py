"""`taxel monitor`."""

import json
import time
from contextlib import AbstractContextManager, nullcontext
from typing import Annotated

import typer
from rich.console import Console

from taxel.errors import TaxelError
from taxel.monitor import LineView, OnceView, Screen, SkinMonitor, TerminalView, open_watched, watch
from taxel.monitor.header import line
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, BASELINE_SAMPLES
from taxel.skin import Skin

LINES_HZ = 1.0


class NothingCameError(TaxelError):
    """There was nothing to show."""


def monitor(
    url: Annotated[str, typer.Argument(help="serial:///dev/ttyUSB0, emulator: or file:capture.bin")],
    web: Annotated[bool, typer.Option("--web", help="Show the hand in 3-D in a browser; needs viser.")] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page on 127.0.0.1; 0: a free one.")] = 8080,
    hand: Annotated[
        str | None, typer.Option(help="Packaged hand or description file; of a recording, its own by default.")
    ] = None,
    rate: Annotated[float | None, typer.Option(help="Scans a second; as many as the bus gives if left out.")] = None,
    speed: Annotated[float, typer.Option(help="Speed at which a capture plays.")] = 1.0,
    baseline: Annotated[
        int, typer.Option(min=2, max=10000, help="Frames of each board that its baseline is taken from.")
    ] = BASELINE_SAMPLES,
    threshold: Annotated[
        float, typer.Option(min=1.0, help="Signal in counts above which a taxel is active.")
    ] = ACTIVATION_THRESHOLD_COUNTS,
    seconds: Annotated[float | None, typer.Option(help="End after so many seconds.")] = None,
    once: Annotated[
        bool, typer.Option("--once", help="Show the skin once, when its baseline is known, and end.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="A line of JSON a second.")] = False,
) -> None:
    """Show the skin live: boards as heat maps, rates, errors and active taxels; or in 3-D in a browser.

    Keys on the terminal: q ends (so does Ctrl-C), b takes the baseline again, t shows the table of boards. Nothing may
    touch the skin while the baseline is taken. Into a pipe goes one line a second.

    Example: taxel monitor emulator: --seconds 2
    """
    console = Console(markup=False)
    with _opening(console, url):
        skin = open_watched(url, hand, rate, speed)
    with skin:
        model = SkinMonitor(skin, baseline, threshold)
        title = f"{url} · hand {skin.hand.name}"
        try:
            if web:
                _in_browser(skin, model, title, port, seconds)
            elif once:
                _once(skin, model, console, title, as_json, seconds)
            elif as_json or not console.is_terminal:
                watch(skin, model, LineView(lambda text: print(text, flush=True), as_json), seconds, LINES_HZ)
            else:
                _on_terminal(skin, model, console, title, seconds)
        except KeyboardInterrupt:
            return  # the way to end it


def _opening(console: Console, url: str) -> AbstractContextManager[object]:
    """Says what is waited for, on a terminal."""
    return console.status(f"opening {url}: waiting for the hub") if console.is_terminal else nullcontext()


def _on_terminal(skin: Skin, model: SkinMonitor, console: Console, title: str, seconds: float | None) -> None:
    view = TerminalView(console, model, title)
    try:
        with view:
            watch(skin, model, view, seconds)
    finally:
        if view.last is not None:
            console.print(line(view.last), soft_wrap=True, highlight=False)


def _once(skin: Skin, model: SkinMonitor, console: Console, title: str, as_json: bool, seconds: float | None) -> None:
    reading = watch(skin, model, OnceView(), seconds)
    if as_json:
        print(json.dumps(reading.as_dict()))
    elif console.is_terminal:
        width, height = console.size
        has_colour = console.color_system is not None and not console.no_color
        screen = Screen(skin.hand, title, model.threshold)
        console.print(screen.draw(reading, width, height - 1, has_colour), soft_wrap=True)
    else:
        print(line(reading))
    if not reading.frames:
        raise NothingCameError(f"{skin.link.name}: no frame came; {reading.advice}")


def _in_browser(skin: Skin, model: SkinMonitor, title: str, port: int, seconds: float | None) -> None:
    from taxel.monitor.web import WebView

    with WebView(model, title, port) as view:
        print(f"the skin is at {view.url}; Ctrl-C ends it", flush=True)
        reading = watch(skin, model, view, seconds)
        print(line(reading), flush=True)
        while reading.is_ended and seconds is None:  # the end of a capture can still be looked at
            time.sleep(0.2)
