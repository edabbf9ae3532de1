"""One board's update, as a talk that can run beside those of other boards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from taxel_protocol.bootloader import LAYOUTS, BootDevice, row_sum
from taxel_tools.application import confirm, read_identity, version_of, wait_for_application
from taxel_tools.errors import BoardError, TransferError
from taxel_tools.files.firmware import Firmware, FirmwareImage, slot_name
from taxel_tools.session import BootInfo, BootSession
from taxel_tools.steps import Clock, Pause, Steps

TRIAL_S: Final = 8.0
"""How long a new image may take to answer: three tries, each ended by a watchdog of a second, and the listening."""
SCAN_S: Final = 10.0
CONFIRM_WRITE_S: Final = 0.05


@dataclass(frozen=True)
class Progress:
    """How far one board's update is: a word for what it does, rows behind it, rows in all."""

    address: int
    stage: str
    done: int = 0
    total: int = 0


@dataclass(frozen=True)
class Outcome:
    """What became of a board: versions before and after, slot, rows written and found right, seconds.

    `is_written` is False if the board ran this very image already.
    """

    address: int
    before: tuple[int, int, int] | None
    after: tuple[int, int, int]
    slot: int
    rows_written: int
    rows_kept: int
    is_written: bool
    seconds: float


Report = Callable[[Progress], None]


def update(address: int, firmware: Firmware, now_s: Clock, report: Report, force: bool = False) -> Steps[Outcome]:
    """Bring `firmware` to the board at `address`: write the free slot, read back, start, see it confirmed.

    May be cut off anywhere and begun anew: rows that read back right from the slot's beginning on are not written
    again. force: write although the board runs this image. Raises `BoardError` of one line, and `TransferError`.
    """
    return (yield from _Update(address, firmware, now_s, report, force).run())


class _Update:
    def __init__(self, address: int, firmware: Firmware, now_s: Clock, report: Report, force: bool) -> None:
        self.address = address
        self.firmware = firmware
        self.now_s = now_s
        self.report = report
        self.force = force
        self.session = BootSession(address, now_s)
        self.kept = self.written = 0

    def run(self) -> Steps[Outcome]:
        began = self.now_s()
        before = yield from self._version()
        self.report(Progress(self.address, "entering"))
        yield from self.session.enter()
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

    def _outcome(self, before: tuple[int, int, int] | None, slot: int, is_written: bool, began: float) -> Outcome:
        seconds = self.now_s() - began
        after = self.firmware.version
        return Outcome(self.address, before, after, slot, self.written, self.kept, is_written, seconds)

    def _version(self) -> Steps[tuple[int, int, int] | None]:
        try:
            identity = yield from read_identity(self.address)
        except TransferError:  # it may be writing, or restarting
            return None
        return None if identity is None else version_of(identity)

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

    def _leave(self, before: tuple[int, int, int] | None, slot: int, began: float) -> Steps[Outcome]:
        yield from self.session.exit()
        yield from wait_for_application(self.address, self.now_s, TRIAL_S)
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

    def _start(self, image: FirmwareImage, before: tuple[int, int, int] | None) -> Steps[None]:
        total = self._total(image)
        self.report(Progress(self.address, "starting", total, total))
        yield from self.session.exit()
        yield Pause(CONFIRM_WRITE_S)
        identity = yield from wait_for_application(self.address, self.now_s, TRIAL_S)
        self._check_version(identity, before)
        self.report(Progress(self.address, "confirming", total, total))
        yield from confirm(self.address, self.now_s, SCAN_S)
        yield Pause(CONFIRM_WRITE_S)
        yield from self.session.enter()  # only the bootloader tells, and the new image must let it in
        info = yield from self.session.info()
        yield from self.session.exit()
        if info.confirmed != image.slot:
            raise BoardError(self.address, "the new image has not confirmed itself; the board goes back to the old one")
        if (yield from wait_for_application(self.address, self.now_s, TRIAL_S)) is None:
            raise BoardError(self.address, "the confirmed image does not answer after a restart; unplug and plug it")

    def _check_version(self, identity: dict[str, Any] | None, before: tuple[int, int, int] | None) -> None:
        if identity is None:
            raise BoardError(self.address, f"no application answers {TRIAL_S:g} s after the restart; run this again")
        found = version_of(identity)
        if found != self.firmware.version:
            now = f"the board is back on {dotted(found)}" if found == before else f"the board runs {dotted(found)}"
            raise BoardError(
                self.address,
                f"the new image {dotted(self.firmware.version)} did not come up, {now}; do not use this file",
            )


def dotted(version: tuple[int, int, int] | None) -> str:
    """1.2.3; `?` for none."""
    return "?" if version is None else ".".join(str(part) for part in version)
