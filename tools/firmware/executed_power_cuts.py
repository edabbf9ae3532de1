"""Power cuts during `taxel flash` on an executed board: the bootloader and applications run as ARM code.

    python tools/firmware/executed_power_cuts.py [--cuts 1000] [--seed 1]

Each update installs the images of `make firmware` under a new version. The power is cut at a random time in one of its
writes, and in half of the cases also in a write of the repeated update. After each cut the old or the new version must
run; the repeated command must succeed, and the slot must contain the image. The exit status is 1 otherwise.
"""

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
from executed_world import BOARD_IMAGE, IMAGES, find_image_files, format_image_line, make_firmware
from flash_worlds import make_small_world

from taxel.errors import TaxelError
from taxel.link.virtual import VirtualWorld
from taxel_protocol.bootloader import LAYOUTS
from taxel_tools.files import Firmware

POWER_OFF_S: Final = 0.03
RUNS_MAX: Final = 5
CHANGED_ROWS: Final = 8
"""Number of rows that differ between versions, at least; unchanged rows are not written again."""
RECORD_WRITES: Final = 3
"""Number of other writes of an update: pending, trial, confirmation."""
Version = tuple[int, int, int]


@dataclass
class Cuts:
    """Result of a series of power cuts.

    outcomes: number of cuts by (time within a write, "old" or "new" version that runs afterwards). updates: number of
    successful updates. torn: rows that a cut left partly written. stack: largest stack in bytes. failure: first
    failure; None without one.
    """

    outcomes: Counter[tuple[str, str]] = field(default_factory=Counter)
    updates: int = 0
    torn: int = 0
    stack: int = 0
    virtual_s: float = 0.0
    failure: str | None = None

    @property
    def cut_count(self) -> int:
        """Number of power cuts so far."""
        return sum(self.outcomes.values())


def _sample_time_s(generator: random.Random) -> float:
    """Return a random time in seconds after the start of a flash write, at which the power is cut."""
    return generator.choice(POINTS_S) if generator.random() < 0.3 else generator.uniform(1e-6, WRITE_S - 1e-6)


class _Board:
    """The board under test and the version that it runs."""

    def __init__(self, world: VirtualWorld, images: Path) -> None:
        """Connect to a board of `world` that executes compiled firmware. images: folder of the firmware images."""
        self.world, self.images = world, images
        self.route = BoardRoute(world, through_hub=False)
        self.version = self._read_version()

    def _read_version(self) -> Version:
        """Return the firmware version that the board runs. Raises `TaxelError` if no application starts."""
        version = self.route.version()
        if version is None:
            raise TaxelError("bricked: no application starts")
        return version

    def update(self, number: int, planned_cuts: int, result: Cuts) -> None:
        """Update the board's firmware until the update succeeds and all planned power cuts have occurred.

        number: number of the update, which determines the version. Adds cuts and update to `result`. Raises
        `TaxelError`.
        """
        firmware = make_firmware((1, number // 256, number % 256), self.images, rows=CHANGED_ROWS)
        target = firmware.images[0].version
        cuts_before = counted_cuts = self.world.count_power_cuts(BOARD)
        for _ in range(RUNS_MAX):
            failure = self._try_update(firmware)
            self.world.run(POWER_OFF_S + 0.01)
            version = self._read_version()
            for cut in self.world.read_power_cuts(BOARD, counted_cuts):
                result.outcomes[name_moment(cut.after_s), "new" if version == target else "old"] += 1
            counted_cuts = self.world.count_power_cuts(BOARD)
            if version not in (self.version, target):
                raise TaxelError(f"{version} runs, expected {self.version} or {target}")
            if failure is None and counted_cuts - cuts_before == planned_cuts:
                break
        else:
            cuts = f"{counted_cuts - cuts_before} of {planned_cuts} cuts"
            raise TaxelError(f"{RUNS_MAX} runs did not finish the update ({cuts}): {failure}")
        self._check_image(firmware)
        self.version = target
        result.updates += 1

    def _try_update(self, firmware: Firmware) -> str | None:
        """Run the update command once. Returns the error message of a failed update, or None."""
        try:
            self.route.update(firmware)
        except TaxelError as error:
            return str(error)
        return None

    def _check_image(self, firmware: Firmware) -> None:
        """Check that a slot contains the new image and that the processor has not faulted since its last start."""
        flash, layout = self.world.read_flash(BOARD).data, LAYOUTS[firmware.device]
        if not any(flash[layout.slot_address(image.slot) :].startswith(image.data) for image in firmware.images):
            raise TaxelError("the command succeeded, but neither slot contains the new image")
        processor = self.world.read_processor(BOARD)
        if processor.is_broken or processor.faults or not processor.is_application:
            raise TaxelError(f"expected a running application without faults, found {processor}")


def cut_updates(cuts: int, seed: int = 1, images: Path = IMAGES) -> Cuts:
    """Run firmware updates with at least `cuts` power cuts in total, up to the first failure.

    Each update has one cut or two; the second cut hits a row that the repeated update still has to write.
    images: folder of the firmware images that the emulated board executes.
    """
    generator, result = random.Random(f"executed {seed}"), Cuts()
    text = make_small_world(2, ["boot_listens 1"], seed) + format_image_line(BOARD)
    with VirtualWorld(text, files={BOARD_IMAGE: find_image_files(images)[BOARD_IMAGE]}) as world:
        world.run(0.4)
        board = _Board(world, images)
        try:
            while result.cut_count < cuts:
                first_operation = generator.randint(1, CHANGED_ROWS + RECORD_WRITES)
                plan = [(first_operation, _sample_time_s(generator))]
                if first_operation <= CHANGED_ROWS and generator.random() < 0.5:
                    plan.append((generator.randint(1, CHANGED_ROWS - first_operation + 1), _sample_time_s(generator)))
                for operation, after_s in plan:
                    world.plan_power_cut(BOARD, operation, after_s, POWER_OFF_S)
                board.update(result.updates, len(plan), result)
                result.stack = max(result.stack, world.read_processor(BOARD).stack)
        except TaxelError as error:
            result.failure = f"update {result.updates}: {error}"
        result.torn, result.virtual_s = world.read_flash(BOARD).torn, world.now_s
    return result


def main() -> int:
    """Run firmware updates with power cuts and print the outcomes; the exit status is 1 after a failure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cuts", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--images", type=Path, default=IMAGES, help="folder of the images that `make firmware` builds")
    options = parser.parse_args()
    try:
        result = cut_updates(options.cuts, options.seed, options.images)
    except OSError as error:
        reason = f"{error.filename}: {error.strerror}; build the images with `make firmware`, or correct --images"
        print(f"executed_power_cuts: {reason}", file=sys.stderr)
        return 1
    for (moment, outcome), count in sorted(result.outcomes.items()):
        print(f"{count:6d} cuts {moment}: the {outcome} version runs")
    print(
        f"{result.cut_count} cuts, {result.torn} rows torn, {result.updates} updates succeeded in "
        f"{result.virtual_s:.0f} virtual seconds, seed {options.seed}; stack {result.stack} bytes; "
        f"{result.failure or 'no failure'}"
    )
    return 0 if result.failure is None else 1


if __name__ == "__main__":
    sys.exit(main())
