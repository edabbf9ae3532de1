"""One board's update, or the hub's, as a talk that can run beside others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from taxel_protocol.bootloader import LAYOUTS, BootDevice, row_sum
from taxel_tools.errors import BoardError
from taxel_tools.files.firmware import Firmware, FirmwareImage, slot_name
from taxel_tools.session import BootInfo
from taxel_tools.steps import Clock, Pause, Steps, Version
from taxel_tools.targets import BoardTarget, Target

TRIAL_S: Final = 8.0
"""How long a new image may take to answer: three tries, each ended by a watchdog of a second, and the listening."""
SCAN_S: Final = 10.0
CONFIRM_WRITE_S: Final = 0.05


@dataclass(frozen=True)
class Progress:
    """How far one update is: a word for what it does, rows behind it, rows in all."""

    address: int
    stage: str
    done: int = 0
    total: int = 0


@dataclass(frozen=True)
class Outcome:
    """What became of a board or the hub: versions before and after, slot, rows written and found right, seconds.

    `is_written` is False if it ran this very image already.
    """

    address: int
    before: Version | None
    after: Version
    slot: int
    rows_written: int
    rows_kept: int
    is_written: bool
    seconds: float


Report = Callable[[Progress], None]


def update(address: int, firmware: Firmware, now_s: Clock, report: Report, force: bool = False) -> Steps[Outcome]:
    """Bring `firmware` to the board at `address`, as `update_target` does."""
    return update_target(BoardTarget(address, now_s), firmware, report, force)


def update_target(target: Target, firmware: Firmware, report: Report, force: bool = False) -> Steps[Outcome]:
    """Bring `firmware` to a board or the hub: write the free slot, read back, start, see it confirmed.

    May be cut off anywhere and begun anew: rows that read back right from the slot's beginning on are not written
    again. force: write although it runs this image. Raises `BoardError` of one line, and `TransferError`.
    """
    return (yield from _Update(target, firmware, report, force).run())


class _Update:
    def __init__(self, target: Target, firmware: Firmware, report: Report, force: bool) -> None:
        self.target = target
        self.address = target.address
        self.firmware = firmware
        self.now_s = target.now_s
        self.report = report
        self.force = force
        self.session = target.session
        self.kept = self.written = 0

    def run(self) -> Steps[Outcome]:
        began = self.now_s()
        before = yield from self.target.version()
        self.report(Progress(self.address, "entering"))
        yield from self.target.enter()
        info = yield from self.session.info()
        try:
            self._check(info)
            runs_already = not self.force and (yield from self._runs_already(info))
            image = self.firmware.image_for(info.target) if not runs_already else None
            if image is None and not runs_already:
                raise BoardError(
                    self.address,
                    f"its free slot is {slot_name(info.target)}, but {self.firmware.source} is linked for slot "
                    f"{slot_name(1 - info.target)} only; give the file linked for {slot_name(info.target)} too",
                )
        except BoardError:
            yield from self.session.exit()
            raise
        if image is None:
            return (yield from self._leave(before, 1 - info.target, began))
        yield from self._program(image)
        yield from self._start(image, before)
        self.report(Progress(self.address, "done", self._total(image), self._total(image)))
        return self._outcome(before, image.slot, True, began)

    def _outcome(self, before: Version | None, slot: int, is_written: bool, began: float) -> Outcome:
        seconds = self.now_s() - began
        after = self.firmware.version
        return Outcome(self.address, before, after, slot, self.written, self.kept, is_written, seconds)

    def _check(self, info: BootInfo) -> None:
        firmware = self.firmware
        if info.device != firmware.device:
            names = {BootDevice.BOARD: "a sensor board", BootDevice.HUB: "the hub"}
            raise BoardError(
                self.address,
                f"is {names.get(BootDevice(info.device))}, but {firmware.source} is for {names[firmware.device]}; "
                "give the file of this device",
            )
        if firmware.kind and info.kind and info.kind != firmware.kind:
            raise BoardError(
                self.address,
                f"is of kind {info.kind}, but {firmware.source} is for kind {firmware.kind}; give the file of its kind",
            )

    def _runs_already(self, info: BootInfo) -> Steps[bool]:
        kept = 1 - info.target
        metadata = yield from self.session.metadata(kept)
        image = self.firmware.image_for(kept)
        confirmed = info.confirmed == kept
        return confirmed and metadata is not None and image is not None and metadata["custom_id"] == image.crc

    def _leave(self, before: Version | None, slot: int, began: float) -> Steps[Outcome]:
        yield from self.session.exit()
        yield from self.target.wait_for_application(TRIAL_S)
        yield from self.target.settle()
        self.report(Progress(self.address, "runs it already", 1, 1))
        return self._outcome(before, slot, False, began)

    def _total(self, image: FirmwareImage) -> int:
        return len(image.rows())

    def _program(self, image: FirmwareImage) -> Steps[None]:
        """Write what is not there yet; if the whole is wrong although each row's sum was right, write it all."""
        first, last = yield from self.session.free_rows()
        rows = image.rows()
        if first + len(rows) - 1 > last or first != LAYOUTS[image.device].first_rows[image.slot]:
            raise BoardError(self.address, f"wants rows {first} to {last}, which are not those of this file; rescan it")
        self.kept = yield from self._rows_that_stand(first, rows)
        for start in (self.kept, 0):
            self.kept = start
            for place in range(start, len(rows)):
                self.report(Progress(self.address, "writing", place, len(rows)))
                yield from self.session.write_row(first + place, rows[place])
                self.written += 1
            if (yield from self.session.verify_application()):
                if not self.written:  # only an image of which a row was written becomes the next to start by itself
                    yield from self.session.set_active(image.slot)
                return
        raise BoardError(self.address, "the image does not verify although every row reads back right; exchange it")

    def _rows_that_stand(self, first: int, rows: list[bytes]) -> Steps[int]:
        """An update that was cut off has left its rows from the slot's beginning on."""
        for place, row in enumerate(rows):
            if (yield from self.session.row_sum(first + place)) != row_sum(row):
                return place
            self.report(Progress(self.address, "comparing", place, len(rows)))
        return len(rows)

    def _start(self, image: FirmwareImage, before: Version | None) -> Steps[None]:
        total, noun = self._total(image), self.target.noun
        self.report(Progress(self.address, "starting", total, total))
        yield from self.session.exit()
        yield Pause(CONFIRM_WRITE_S)
        self._check_version((yield from self.target.wait_for_application(TRIAL_S)), before)
        self.report(Progress(self.address, "confirming", total, total))
        yield from self.target.confirm(SCAN_S)
        yield Pause(CONFIRM_WRITE_S)
        yield from self.target.enter()  # only the bootloader tells, and the new image must let it in
        info = yield from self.session.info()
        yield from self.session.exit()
        if info.confirmed != image.slot:
            why = f"the new image has not confirmed itself; the {noun} goes back to the old one"
            raise BoardError(self.address, why)
        if (yield from self.target.wait_for_application(TRIAL_S)) is None:
            raise BoardError(self.address, "the confirmed image does not answer after a restart; unplug and plug it")
        yield from self.target.settle()

    def _check_version(self, found: Version | None, before: Version | None) -> None:
        noun = self.target.noun
        if found is None:
            raise BoardError(self.address, f"no application answers {TRIAL_S:g} s after the restart; run this again")
        if found != self.firmware.version:
            now = f"the {noun} is back on {dotted(found)}" if found == before else f"the {noun} runs {dotted(found)}"
            raise BoardError(
                self.address,
                f"the new image {dotted(self.firmware.version)} did not come up, {now}; do not use this file",
            )


def dotted(version: Version | None) -> str:
    """1.2.3; `?` for none."""
    return "?" if version is None else ".".join(str(part) for part in version)
