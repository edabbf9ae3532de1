"""Updates whose power is cut: after each cut the old or the new image runs, byte for byte, and a retry succeeds."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from cut_plan import CutSequence, WorldPlan, moment_of
from cut_records import confirmed_slot, operation_of
from cut_target import BoardWay, HubWay, Way
from flash_worlds import firmware_of, small_world

from taxel.errors import TaxelError
from taxel.link.virtual import VirtualWorld
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_tools.errors import HUB
from taxel_tools.files import Firmware

OFF_S: Final = 0.03
"""How long there is no power."""
RUNS_MAX: Final = 6
"""Of one command: first, after each of two cuts, and some to spare."""
BRICKED: Final = "bricked"
DAMAGED: Final = "damaged"
AGAIN: Final = "cut again"


class CampaignError(TaxelError):
    """What must not happen, has."""


@dataclass(frozen=True)
class Struck:
    """A cut that was made: what it struck, at which moment, and what ran or held afterwards."""

    operation: str
    moment: str
    outcome: str


@dataclass
class WorldResult:
    """What came of the sequences of one world. `runs`: of the command, for each sequence."""

    number: int
    way: str
    struck: list[Struck] = field(default_factory=list)
    runs: list[int] = field(default_factory=list)
    torn: int = 0
    longest_gap_s: float = 0.0
    virtual_s: float = 0.0
    failures: list[str] = field(default_factory=list)


def run_updates(plan: WorldPlan) -> WorldResult:
    """Every sequence of a world, one after the other on the same flash; it ends with the first that fails."""
    result = WorldResult(plan.number, plan.way)
    is_hub = plan.way.startswith("hub")
    text = small_world(1 if is_hub else 2, [f"boot_listens {int(plan.listens)}"], plan.seed + plan.number)
    with VirtualWorld(text) as world:
        world.run(0.3)
        way: Way = HubWay(world) if is_hub else BoardWay(world, plan.way.endswith("hub"))
        for place, sequence in enumerate(plan.sequences):
            try:
                _Update(world, way, plan, place, sequence, result).run()
            except TaxelError as error:
                result.failures.append(f"world {plan.number}, sequence {place} ({sequence}): {error}")
                break
        if isinstance(way, BoardWay):
            result.longest_gap_s = way.beside.longest_gap_s
        result.torn = world.board_flash(way.address).torn
        result.virtual_s = world.now_s
    return result


class _Update:
    """One update with its cuts, from a confirmed image to the next."""

    def __init__(
        self, world: VirtualWorld, way: Way, plan: WorldPlan, place: int, sequence: CutSequence, result: WorldResult
    ) -> None:
        self.world = world
        self.way = way
        self.sequence = sequence
        self.result = result
        device = BootDevice.HUB if way.address == HUB else BootDevice.BOARD
        self.layout = LAYOUTS[device]
        self.version = (1, place // 256, place % 256)
        self.firmware: Firmware = firmware_of(device, sequence.rows, self.version, plan.seed + plan.number)
        flash = world.board_flash(way.address).data
        self.old_slot = confirmed_slot(flash) or 0
        self.old_image = self._slot(flash, self.old_slot)
        self.old_version = way.version()
        self.cuts_before = world.cut_count(way.address)
        self.judged = 0

    def _slot(self, flash: bytes, slot: int) -> bytes:
        begin = self.layout.slot_address(slot)
        return flash[begin : begin + self.layout.slot_size]

    def run(self) -> None:
        for cut in self.sequence.cuts:
            self.world.plan_cut(self.way.address, cut.operation, cut.after_s, OFF_S)
        for runs in range(1, RUNS_MAX + 1):
            failure = self._try()
            seen = self._judge()
            if failure is None and seen == len(self.sequence.cuts):
                self.result.runs.append(runs)
                self._check_end()
                return
        why = f"the last run ended with: {failure}" if failure else f"only {seen} cuts were made"
        raise CampaignError(f"{RUNS_MAX} runs of the command did not finish the update; {why}")

    def _try(self) -> str | None:
        try:
            self.way.update(self.firmware)
        except TaxelError as error:
            return str(error)
        return None

    def _judge(self) -> int:
        """Look at what runs, and put it down to the cuts since the last look; returns how many there are in all.

        A look may bring the next cut about: an image confirms itself when it is talked to.
        """
        while True:
            self.world.run(OFF_S + 0.01)  # the power is back
            made = self._note_cuts(self.way.version())
            try:
                self.way.check_hub()
            except TaxelError:
                if self._cuts() == made:
                    raise
            if self._cuts() == made:
                return made

    def _cuts(self) -> int:
        return self.world.cut_count(self.way.address) - self.cuts_before

    def _note_cuts(self, version: tuple[int, int, int] | None) -> int:
        made = self.world.cuts(self.way.address, self.cuts_before)
        outcome = self._outcome(version)
        for place, cut in enumerate(made[self.judged :], start=self.judged):
            last = place == len(made) - 1
            self.result.struck.append(Struck(operation_of(cut), moment_of(cut.after_s), outcome if last else AGAIN))
        self.judged = len(made)
        if outcome in (BRICKED, DAMAGED):
            raise CampaignError(f"{outcome}: {version} runs, expected {self.old_version} or {self.version}, whole")
        return len(made)

    def _outcome(self, version: tuple[int, int, int] | None) -> str:
        if version is None:
            return BRICKED
        flash = self.world.board_flash(self.way.address).data
        new = self.firmware.image_for(1 - self.old_slot)
        assert new is not None
        if self._slot(flash, self.old_slot) != self.old_image:
            return DAMAGED  # nobody may write the slot in use
        if version == self.version:
            return "new" if self._slot(flash, new.slot).startswith(new.data) else DAMAGED
        return "old" if version == self.old_version else DAMAGED

    def _check_end(self) -> None:
        flash = self.world.board_flash(self.way.address).data
        if self._outcome(self.way.version()) != "new" or confirmed_slot(flash) != 1 - self.old_slot:
            raise CampaignError("the command said that it has succeeded, but the new image does not run confirmed")
