"""One stream of the blind check: its length, its hidden fault, and the secret time at which the fault begins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from taxel.blind.hidden import HiddenCauses


@dataclass(frozen=True)
class StreamWorld:
    """A stream of the blind check.

    number: index in the run. seed: seed of plan, physics and times of the contacts. hidden: the fault, if there is one,
    and the deviations that every skin has. hours: length of the stream after the reference. onset_s: start of the
    fault, seconds after the end of the reference; None without a fault. lasting_s: start and end of a lasting contact
    that is not announced, seconds after the end of the reference; None without such a contact. salt: 256 random bits,
    hexadecimal.
    """

    number: int
    seed: int
    hidden: HiddenCauses
    hours: float
    onset_s: float | None
    lasting_s: tuple[float, float] | None
    salt: str

    def to_json(self) -> dict[str, Any]:
        """Return the world as the JSON values that are sealed."""
        return {
            "number": self.number,
            "seed": self.seed,
            "hidden": self.hidden.to_json(),
            "hours": self.hours,
            "onset_s": self.onset_s,
            "lasting_s": None if self.lasting_s is None else list(self.lasting_s),
            "salt": self.salt,
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> StreamWorld:
        """Create a stream from the JSON values of `to_json`."""
        lasting = data["lasting_s"]
        return cls(
            data["number"],
            data["seed"],
            HiddenCauses.from_json(data["hidden"]),
            data["hours"],
            data["onset_s"],
            None if lasting is None else (lasting[0], lasting[1]),
            data["salt"],
        )
