"""Attack the page of a running monitor with hostile requests and messages; nothing may be accepted.

python tools/attack/attack_web.py [--count 10000] [--seed 1] [--out out/attack_web.json]

Half of the attacks are requests, half are messages on connections that were opened as the user opens them. A request is
accepted if the response has the status 101 or 200. A message is accepted if the monitor neither counts it as ignored
nor ends the connection. The exit status is 1 if anything was accepted, or if the monitor has ended or printed a
traceback.
"""

import argparse
import asyncio
import json
import random
import re
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import msgspec
import zstandard
from hostile_messages import make_message, make_oversized_message
from hostile_requests import ACCEPTED, REQUESTS
from monitor_process import MonitorProcess
from page_client import Request, open_page
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed

from taxel.output import write_whole

PARALLEL = 8
"""Attacks at the same time."""

MESSAGES_PER_CONNECTION = 60
"""Messages on one connection: fewer than the number after which the monitor ends it (`IGNORED_MAX`)."""


async def attack_requests(page: Request, count: int, seed: int) -> dict[str, Counter[int]]:
    """Send `count` hostile requests; return the numbers of responses by kind of attack and status code."""
    results: dict[str, Counter[int]] = {name: Counter() for name in REQUESTS}
    names = [name for _, name in zip(range(count), _cycle(list(REQUESTS)), strict=False)]
    semaphore = asyncio.Semaphore(PARALLEL)

    async def attack(number: int, name: str) -> None:
        """Send one hostile request and count its response."""
        async with semaphore:
            response = await REQUESTS[name](page, random.Random(f"{seed} {number}"))
        results[name][response.status] += 1

    await asyncio.gather(*(attack(number, name) for number, name in enumerate(names)))
    return results


def _cycle(names: list[str]) -> Any:
    """Yield the names in order, endlessly repeated."""
    while True:
        yield from names


async def attack_messages(page: Request, count: int, seed: int) -> tuple[int, int]:
    """Send `count` hostile messages; return the numbers of ordinary and of oversized messages.

    An oversized message ends its connection.
    """
    rng = random.Random(f"{seed} messages")
    ordinary = oversized = 0
    while ordinary + oversized < count:
        connection = await open_page(page)
        uuids = await read_control_uuids(connection)
        reader = asyncio.create_task(_discard(connection))
        for _ in range(min(MESSAGES_PER_CONNECTION, count - ordinary - oversized)):
            if rng.random() < 0.02:
                await _send_oversized(connection, rng)
                oversized += 1
                break
            await connection.send(make_message(rng, uuids))
            ordinary += 1
        else:
            await connection.close()
        await reader
    return ordinary, oversized


async def _send_oversized(connection: ClientConnection, rng: random.Random) -> None:
    """Send a message above the largest size; the monitor must end the connection."""
    try:
        await connection.send(make_oversized_message(rng))
        await asyncio.wait_for(connection.wait_closed(), 20.0)
    except ConnectionClosed:
        pass
    assert connection.close_code in (1006, 1009), connection.close_code


async def _discard(connection: ClientConnection) -> None:
    """Receive and discard the messages of the monitor until the connection ends."""
    try:
        async for _ in connection:
            pass
    except ConnectionClosed:
        pass


async def read_control_uuids(connection: ClientConnection) -> list[str]:
    """Return the identifiers of the controls that the monitor sends to a new page."""
    uuids: list[str] = []
    while True:
        data = await connection.recv()
        assert isinstance(data, bytes)
        size = int.from_bytes(data[8:16], "little")
        for message in msgspec.msgpack.decode(zstandard.decompress(data[16 : 16 + size]))["messages"]:
            if message["type"] == "ReplayDoneMessage":
                return uuids
            if message["type"].startswith("Gui") and message["type"].endswith("Message") and "props" in message:
                uuids.append(message["uuid"])


def count_accepted(results: dict[str, Counter[int]]) -> int:
    """Return the number of requests that the monitor admitted (status codes `ACCEPTED`).

    results: numbers of responses by kind of attack and status code.
    """
    return sum(counts[status] for counts in results.values() for status in ACCEPTED)


def parse_ignored(output: str) -> int:
    """Return the number of ignored messages from the output of a monitor that has ended; 0 if the line is missing."""
    match = re.search(r"(\d+) messages? ignored", output)
    return int(match.group(1)) if match else 0


def main() -> int:
    """Attack a monitor that runs on the emulator, and print a JSON report.

    Returns the exit status: 0 if the monitor accepted nothing, kept running, ended with status 0 and printed no
    traceback; otherwise 1.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    started_s = time.monotonic()
    with MonitorProcess("emulator:", "--control") as monitor:
        page = Request.of_page(monitor.url)
        before_mb = monitor.resident_mb
        results = asyncio.run(attack_requests(page, options.count // 2, options.seed))
        ordinary, oversized = asyncio.run(attack_messages(page, options.count - options.count // 2, options.seed))
        after_mb, is_running = monitor.resident_mb, monitor.is_running
        status, output = monitor.end()
    ignored = parse_ignored(output)
    tracebacks = sum("Traceback" in line for line in monitor.errors)
    report = {
        "seed": options.seed,
        "requests": {name: dict(sorted(counts.items())) for name, counts in results.items()},
        "requests_accepted": count_accepted(results),
        "messages": ordinary,
        "messages_oversized": oversized,
        "messages_accepted": ordinary - ignored,
        "memory_before_mb": before_mb,
        "memory_after_mb": after_mb,
        "monitor_running": is_running and status == 0,
        "tracebacks": tracebacks,
        "seconds": round(time.monotonic() - started_s, 1),
    }
    print(json.dumps(report, indent=2))
    if options.out is not None:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        write_whole(options.out, json.dumps(report, indent=2))
    is_safe = (
        report["requests_accepted"] == report["messages_accepted"] == tracebacks == 0 and report["monitor_running"]
    )
    return 0 if is_safe else 1


if __name__ == "__main__":
    sys.exit(main())
