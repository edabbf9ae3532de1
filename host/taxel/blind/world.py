"""A world of the blind check: its hidden causes, the size of its campaign, and the diagnoses to make."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

from taxel.blind.hidden import HiddenCauses


@dataclass(frozen=True)
class CampaignSize:
    """Size of an indentation campaign: number of approaches, sessions, and repeats per approach and session."""

    approaches: int
    sessions: int
    repeats: int

    @property
    def indentations(self) -> int:
        """Total number of indentations in all sessions of the campaign."""
        return self.approaches * self.sessions * self.repeats


SMALL_CAMPAIGN: Final = CampaignSize(approaches=8, sessions=4, repeats=2)
FULL_HAND_CAMPAIGN: Final = CampaignSize(approaches=24, sessions=4, repeats=1)


@dataclass(frozen=True)
class World:
    """One world of a blind check.

    Attributes:
        number: index in the run.
        hand: name of the packaged hand.
        seed: seed of plan and physics.
        hidden: the hidden causes.
        salt: 256 random bits, hexadecimal.
        is_withheld: diagnose a second time with the world's effect removed from the catalogue.
        is_repeated: diagnose with further analysis seeds.
        size: size of the campaign.
        decoy: name of an effect that is not hidden and is removed from the catalogue in a second diagnosis. Without
            decoys, the removal of an effect would reveal that the effect is present.
    """

    number: int
    hand: str
    seed: int
    hidden: HiddenCauses
    salt: str
    is_withheld: bool = False
    is_repeated: bool = False
    size: CampaignSize = SMALL_CAMPAIGN
    decoy: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the world, with its hidden causes and its salt, as the JSON values that are sealed."""
        return {
            "number": self.number,
            "hand": self.hand,
            "seed": self.seed,
            "hidden": self.hidden.to_json(),
            "salt": self.salt,
            "withheld": self.is_withheld,
            "repeated": self.is_repeated,
            "shape": asdict(self.size),
            "decoy": self.decoy,
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> World:
        """Create a world of the blind check from the JSON values of `to_json`."""
        return cls(
            data["number"],
            data["hand"],
            data["seed"],
            HiddenCauses.from_json(data["hidden"]),
            data["salt"],
            is_withheld=data["withheld"],
            is_repeated=data["repeated"],
            size=CampaignSize(**data["shape"]),
            decoy=data["decoy"],
        )
