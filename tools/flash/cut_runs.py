"""Updates interrupted by power cuts: the old or the new image runs after each cut, and a retry succeeds."""

from dataclasses import dataclass, field
from typing import Final

from cut_plan import CutSequence, WorldPlan, name_moment
from cut_records import find_confirmed_slot, name_operation
from cut_routes import BoardRoute, HubRoute, Route
from flash_worlds import make_firmware_images, make_small_world

from taxel.errors import TaxelError
from taxel.link.virtual import VirtualWorld
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_tools.errors import HUB
from taxel_tools.files import Firmware

OFF_S: Final = 0.03
"""Duration of a power cut in seconds."""
RUNS_MAX: Final = 6
"""Limit of runs of one command: the first, one after each of two cuts, and a margin."""
BRICKED: Final = "bricked"
DAMAGED: Final = "damaged"
CUT_AGAIN: Final = "cut again"


class CampaignError(TaxelError):
    """A violated requirement of the campaign: a bricked device, damaged data, or an update that never succeeds."""


@dataclass(frozen=True)
class CutRecord:
    """A power cut: interrupted operation, phase of the write, and the image or record valid afterwards."""

    operation: str
    moment: str
    outcome: str


@dataclass
class WorldResult:
    """Results of the sequences of one world. `runs`: number of command runs for each sequence."""

    number: int
    route: str
    cut_records: list[CutRecord] = field(default_factory=list)
    runs: list[int] = field(default_factory=list)
    torn: int = 0
    longest_gap_s: float = 0.0
    virtual_s: float = 0.0
    failures: list[str] = field(default_factory=list)


def run_updates(plan: WorldPlan) -> WorldResult:
    """Run the planned updates of an emulated world with their power cuts in order, up to the first failure."""
    result = WorldResult(plan.number, plan.route)
    is_hub = plan.route.startswith("hub")
    text = make_small_world(
        1 if is_hub else 2, [f"boot_listens {int(plan.bootloader_listens)}"], plan.seed + plan.number
    )
    with VirtualWorld(text) as world:
        world.run(0.3)
        route: Route = HubRoute(world) if is_hub else BoardRoute(world, plan.route.endswith("hub"))
        for index, sequence in enumerate(plan.sequences):
            try:
                _Update(world, route, plan, index, sequence, result).run()
            except TaxelError as error:
                result.failures.append(f"world {plan.number}, sequence {index} ({sequence}): {error}")
                break
        if isinstance(route, BoardRoute):
            result.longest_gap_s = route.neighbour.longest_gap_s
        result.torn = world.read_flash(route.address).torn
        result.virtual_s = world.now_s
    return result


class _Update:
    """One update with its power cuts, from a confirmed image to the next."""

    def __init__(
        self, world: VirtualWorld, route: Route, plan: WorldPlan, index: int, sequence: CutSequence, result: WorldResult
    ) -> None:
        """Prepare a firmware update during which the power is cut.

        route: access to the board or hub to update. index: number of the update, which determines the new version.
        sequence: planned power cuts. result: receives one record per cut.
        """
        self.world = world
        self.route = route
        self.sequence = sequence
        self.result = result
        device = BootDevice.HUB if route.address == HUB else BootDevice.BOARD
        self.layout = LAYOUTS[device]
        self.version = (1, index // 256, index % 256)
        self.firmware: Firmware = make_firmware_images(device, sequence.rows, self.version, plan.seed + plan.number)
        flash = world.read_flash(route.address).data
        self.old_slot = find_confirmed_slot(flash) or 0
        self.old_image = self._read_slot(flash, self.old_slot)
        self.old_version = route.version()
        self.cuts_before = world.count_power_cuts(route.address)
        self.recorded_count = 0

    def _read_slot(self, flash: bytes, slot: int) -> bytes:
        """Return the bytes of a firmware slot. flash: content of the whole flash."""
        begin = self.layout.slot_address(slot)
        return flash[begin : begin + self.layout.slot_size]

    def run(self) -> None:
        """Repeat the update command until the image is confirmed; the planned cuts interrupt it.

        Raises `CampaignError` if the command does not succeed in `RUNS_MAX` runs or if the device is wrong afterwards.
        """
        for cut in self.sequence.cuts:
            self.world.plan_power_cut(self.route.address, cut.operation, cut.after_s, OFF_S)
        for runs in range(1, RUNS_MAX + 1):
            failure = self._try_update()
            cut_count = self._record_outcomes()
            if failure is None and cut_count == len(self.sequence.cuts):
                self.result.runs.append(runs)
                self._check_end()
                return
        cause = f"the last run ended with: {failure}" if failure else f"only {cut_count} cuts were made"
        raise CampaignError(f"{RUNS_MAX} runs of the command did not finish the update; {cause}")

    def _try_update(self) -> str | None:
        """Run the update command once. Returns the error message of a failed update, or None."""
        try:
            self.route.update(self.firmware)
        except TaxelError as error:
            return str(error)
        return None

    def _record_outcomes(self) -> int:
        """Record the outcome of the new power cuts, and return the number of cuts of this update so far.

        Checking the device can trigger the next planned cut, because an image confirms itself when a host communicates
        with it.
        """
        while True:
            self.world.run(OFF_S + 0.01)  # Until the power is back.
            recorded_count = self._record_cuts(self.route.version())
            try:
                self.route.check_hub()
            except TaxelError:
                if self._count_cuts() == recorded_count:
                    raise
            if self._count_cuts() == recorded_count:
                return recorded_count

    def _count_cuts(self) -> int:
        """Return the number of power cuts of this update so far."""
        return self.world.count_power_cuts(self.route.address) - self.cuts_before

    def _record_cuts(self, version: tuple[int, int, int] | None) -> int:
        """Record the new power cuts with the version that runs afterwards, and return the number of cuts so far.

        Raises `CampaignError` if the device does not start or its flash is damaged.
        """
        cuts = self.world.read_power_cuts(self.route.address, self.cuts_before)
        outcome = self._classify_outcome(version)
        for i, cut in enumerate(cuts[self.recorded_count :], start=self.recorded_count):
            is_last = i == len(cuts) - 1
            record = CutRecord(name_operation(cut), name_moment(cut.after_s), outcome if is_last else CUT_AGAIN)
            self.result.cut_records.append(record)
        self.recorded_count = len(cuts)
        if outcome in (BRICKED, DAMAGED):
            raise CampaignError(f"{outcome}: expected version {self.old_version} or {self.version}, found {version}")
        return len(cuts)

    def _classify_outcome(self, version: tuple[int, int, int] | None) -> str:
        """Return the state after a power cut: "old" or "new" version, `BRICKED` or `DAMAGED`.

        BRICKED: no version runs. DAMAGED: wrong bytes in the flash, or a version that is neither old nor new.
        """
        if version is None:
            return BRICKED
        flash = self.world.read_flash(self.route.address).data
        new = self.firmware.select_image_for(1 - self.old_slot)
        assert new is not None
        if self._read_slot(flash, self.old_slot) != self.old_image:
            return DAMAGED  # The slot in use must never be written.
        if version == self.version:
            return "new" if self._read_slot(flash, new.slot).startswith(new.data) else DAMAGED
        return "old" if version == self.old_version else DAMAGED

    def _check_end(self) -> None:
        """Check after a successful update that the new image runs and is confirmed.

        Raises `CampaignError` otherwise.
        """
        flash = self.world.read_flash(self.route.address).data
        if self._classify_outcome(self.route.version()) != "new" or find_confirmed_slot(flash) != 1 - self.old_slot:
            raise CampaignError("the command reported success, but the new image does not run confirmed")
