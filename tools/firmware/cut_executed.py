"""Cut the power of an executed board in the writes of `taxel flash`: the real bootloader and applications, as ARM code.

python tools/firmware/cut_executed.py [--cuts 1000] [--seed 1]

Each update gives the board the images of `make firmware` under a new version. One of its writes is cut at a random
instant, and often one of the writes that mend it. After each cut the old or the new version must run; the command,
given again, must succeed, with the slot's bytes whole. Exit status 1 if that is not so.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

sys.path.insert(1, str(Path(__file__).parents[1] / "flash"))

from cut_plan import POINTS_S, WRITE_S, name_moment
from cut_routes import BOARD, BoardRoute
from executed_world import BOARD_IMAGE, IMAGES, files, firmware_with, image_line
from flash_worlds import make_small_world

from taxel.errors import TaxelError
from taxel.link.virtual import VirtualWorld
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_tools.files import Firmware

OFF_S: Final = 0.03
RUNS_MAX: Final = 5
ROWS: Final = 8
"""Of the image that differ from one version to the next, at least; the others are not written again."""
RECORDS: Final = 3
"""Writes of an update beside the rows: pending, a try, the confirmation."""
Version = tuple[int, int, int]


@dataclass
class Cuts:
    """What the cuts have struck, updates that succeeded, and what went wrong."""

    struck: Counter[tuple[str, str]] = field(default_factory=Counter)
    updates: int = 0
    torn: int = 0
    stack: int = 0
    virtual_s: float = 0.0
    failure: str | None = None

    @property
    def made(self) -> int:
        """Cuts that were made."""
        return sum(self.struck.values())


def _instant(generator: random.Random) -> float:
    return generator.choice(POINTS_S) if generator.random() < 0.3 else generator.uniform(1e-6, WRITE_S - 1e-6)


class _Board:
    """The board that is cut, and what runs on it."""

    def __init__(self, world: VirtualWorld, images: Path) -> None:
        self.world, self.images = world, images
        self.way = BoardRoute(world, through_hub=False)
        self.version = self._running()

    def _running(self) -> Version:
        version = self.way.version()
        if version is None:
            raise TaxelError("bricked: no application comes up")
        return version

    def update(self, number: int, planned: int, result: Cuts) -> None:
        """One update, given again until it has succeeded and all its cuts are made. Raises `TaxelError`."""
        firmware = firmware_with((1, number // 256, number % 256), self.images, rows=ROWS)
        target = firmware.images[0].version
        before = seen = self.world.cut_count(BOARD)
        for _ in range(RUNS_MAX):
            failure = self._try(firmware)
            self.world.run(OFF_S + 0.01)
            version = self._running()
            for cut in self.world.cuts(BOARD, seen):
                result.struck[name_moment(cut.after_s), "new" if version == target else "old"] += 1
            seen = self.world.cut_count(BOARD)
            if version not in (self.version, target):
                raise TaxelError(f"{version} runs, expected {self.version} or {target}")
            if failure is None and seen - before == planned:
                break
        else:
            raise TaxelError(
                f"{RUNS_MAX} runs did not finish the update ({seen - before} of {planned} cuts): {failure}"
            )
        self._check(firmware)
        self.version = target
        result.updates += 1

    def _try(self, firmware: Firmware) -> str | None:
        try:
            self.way.update(firmware)
        except TaxelError as error:
            return str(error)
        return None

    def _check(self, firmware: Firmware) -> None:
        """One slot holds the new image, whole, and no processor has faulted since the last start."""
        flash, layout = self.world.board_flash(BOARD).data, LAYOUTS[BootDevice.BOARD]
        if not any(flash[layout.slot_address(one.slot) :].startswith(one.data) for one in firmware.images):
            raise TaxelError("the command has succeeded, but neither slot holds the new image")
        processor = self.world.processor(BOARD)
        if processor.is_broken or processor.faults or not processor.is_application:
            raise TaxelError(f"the processor is not well: {processor}")


def cut_updates(cuts: int, seed: int = 1, images: Path = IMAGES) -> Cuts:
    """Updates with so many cuts at least; ends with the first failure."""
    generator, result = random.Random(f"executed {seed}"), Cuts()
    text = make_small_world(2, ["boot_listens 1"], seed) + image_line(BOARD)
    with VirtualWorld(text, files={BOARD_IMAGE: files(images)[BOARD_IMAGE]}) as world:
        world.run(0.4)
        board = _Board(world, images)
        try:
            while result.made < cuts:
                first = generator.randint(1, ROWS + RECORDS)
                plan = [(first, _instant(generator))]
                if first <= ROWS and generator.random() < 0.5:
                    plan.append((generator.randint(1, ROWS - first + 1), _instant(generator)))
                for operation, after_s in plan:
                    world.plan_cut(BOARD, operation, after_s, OFF_S)
                board.update(result.updates, len(plan), result)
                result.stack = max(result.stack, world.processor(BOARD).stack)
        except TaxelError as error:
            result.failure = f"update {result.updates}: {error}"
        result.torn, result.virtual_s = world.board_flash(BOARD).torn, world.now_s
    return result


def main() -> int:
    """Make the cuts, and say what came of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cuts", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--images", type=Path, default=IMAGES, help="folder of the images that `make firmware` builds")
    options = parser.parse_args()
    try:
        result = cut_updates(options.cuts, options.seed, options.images)
    except OSError as error:
        print(f"cut_executed: {error}", file=sys.stderr)
        return 1
    for (moment, outcome), count in sorted(result.struck.items()):
        print(f"{count:6d} cuts {moment}: the {outcome} version runs")
    print(
        f"{result.made} cuts, {result.torn} rows torn, {result.updates} updates succeeded in {result.virtual_s:.0f} "
        f"virtual seconds, seed {options.seed}; stack {result.stack} bytes; {result.failure or 'nothing bricked'}"
    )
    return 0 if result.failure is None else 1


if __name__ == "__main__":
    sys.exit(main())
