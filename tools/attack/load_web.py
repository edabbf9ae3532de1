"""Load the page of a running monitor with many pages, slow readers and invalid frames; its memory must stay constant.

python tools/attack/load_web.py [--clients 60] [--seconds 60] [--out out/load_web.json]

Of the clients, two thirds read everything, one sixth reads nothing, and one sixth sends invalid WebSocket frames and
messages and connects again when the monitor ends the connection. The exit status is 1 if the resident memory grows by
more than `GROWTH_MB` in the second half of the time, if a reading page receives nothing, or if the monitor has ended.
"""

import argparse
import asyncio
import contextlib
import json
import random
import sys
import time
from pathlib import Path

import msgspec
from hostile_messages import make_message
from monitor_process import MonitorProcess
from page_client import Request, open_page
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from taxel.output import write_whole

GROWTH_MB = 8.0
"""Largest growth of the memory in the second half, MB: twice the variation of repeated runs (measured: below 4 MB)."""


CAMERA = msgspec.msgpack.encode(
    {
        "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, 1.0], "fov": 1.0,
        "near": 0.01, "far": 100.0, "image_height": 600, "image_width": 900, "look_at": [0.0, 0.0, 0.0],
        "up_direction": [0.0, 0.0, 1.0],
    }
)  # fmt: skip
"""A valid camera pose, with which a page reports that it is shown."""


class Load:
    """Clients of a page; `received` counts the bytes of each reading client."""

    def __init__(self, page: Request, clients: int, seconds: float, seed: int) -> None:
        """Prepare the load; `run` starts the clients.

        page: request that opens the page. clients: number of clients. seconds: time from now on after which all clients
        end. seed: seed of the invalid frames and messages.
        """
        self._page = page
        self._clients = clients
        self._end_s = time.monotonic() + seconds
        self._seed = seed
        self.received: list[int] = []

    async def run(self) -> None:
        """Run all clients until the end of the time."""
        sixth = self._clients // 6
        readers = self._clients - 2 * sixth
        self.received = [0] * readers
        clients = [self._read(number) for number in range(readers)]
        clients += [self._stall() for _ in range(sixth)]
        clients += [self._send_garbage(number) for number in range(sixth)]
        await asyncio.gather(*clients)

    async def _read(self, number: int) -> None:
        """Read everything as a page does."""
        connection = await open_page(self._page, open_timeout=60.0)
        await connection.send(CAMERA)
        while time.monotonic() < self._end_s:
            with contextlib.suppress(TimeoutError):
                self.received[number] += len(await asyncio.wait_for(connection.recv(), 1.0))
        await connection.close()

    async def _stall(self) -> None:
        """Open a connection and read nothing: the buffers between both ends fill."""
        connection = await open_page(self._page, open_timeout=60.0, max_queue=1)
        await connection.send(CAMERA)
        connection.transport.pause_reading()
        while time.monotonic() < self._end_s:
            await asyncio.sleep(0.5)
        connection.transport.abort()

    async def _send_garbage(self, number: int) -> None:
        """Send invalid messages, and now and then bytes that are no WebSocket frame."""
        rng = random.Random(f"{self._seed} {number}")
        while time.monotonic() < self._end_s:
            with contextlib.suppress(ConnectionClosed, InvalidHandshake, ConnectionError, RuntimeError):
                connection = await open_page(self._page, open_timeout=60.0)
                await self._send_until_closed(connection, rng)

    async def _send_until_closed(self, connection: ClientConnection, rng: random.Random) -> None:
        """Send invalid messages until the monitor ends the connection."""
        while time.monotonic() < self._end_s:
            if rng.random() < 0.02:
                connection.transport.write(rng.randbytes(200))
            await connection.send(make_message(rng, ["unknown"]))
            await asyncio.sleep(0.02)
        connection.transport.abort()


async def _watch_memory(monitor: MonitorProcess, seconds: float) -> list[float]:
    """Return the resident memory of the monitor once in each of `seconds` seconds, MB."""
    values = []
    for _ in range(round(seconds)):
        await asyncio.sleep(1.0)
        values.append(monitor.resident_mb)
    return values


async def _run(monitor: MonitorProcess, clients: int, seconds: float, seed: int) -> tuple[list[float], list[int]]:
    """Run the load, and return two lists.

    The first is the resident memory of the monitor after each second, MB. The second is the number of bytes that each
    reading client has received.
    """
    load = Load(Request.of_page(monitor.url), clients, seconds, seed)
    memory, _ = await asyncio.gather(_watch_memory(monitor, seconds), load.run())
    return memory, load.received


def main() -> int:
    """Load a monitor that runs on the emulator, and print a JSON report.

    Returns the exit status: 1 if the memory of the monitor grows by more than `GROWTH_MB` in the second half of the
    run, if a reading client receives nothing, or if the monitor has ended or printed a traceback; otherwise 0.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clients", type=int, default=60)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    with MonitorProcess("emulator:") as monitor:
        memory, received = asyncio.run(_run(monitor, options.clients, options.seconds, options.seed))
        is_running = monitor.is_running
        status, output = monitor.end()
    growth_mb = max(memory[-3:]) - memory[len(memory) // 2]
    report = {
        "clients": options.clients,
        "seconds": options.seconds,
        "memory_mb": [round(memory[place], 1) for place in (0, len(memory) // 2, -1)],
        "growth_in_second_half_mb": round(growth_mb, 1),
        "least_received_bytes": min(received),
        "monitor_running": is_running and status == 0,
        "tracebacks": sum("Traceback" in line for line in monitor.errors),
        "last_line": output.strip().splitlines()[0] if output.strip() else "",
    }
    print(json.dumps(report, indent=2))
    if options.out is not None:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        write_whole(options.out, json.dumps(report, indent=2))
    is_stable = growth_mb <= GROWTH_MB and min(received) > 0 and report["monitor_running"] and not report["tracebacks"]
    return 0 if is_stable else 1


if __name__ == "__main__":
    sys.exit(main())
