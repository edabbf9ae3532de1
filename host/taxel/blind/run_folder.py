"""The folder of a blind check: commitments, keys and worlds."""

import json
from pathlib import Path
from typing import Any, Final

from taxel.blind.errors import BlindRunError
from taxel.blind.sampling import sample_worlds
from taxel.blind.seal import commitment, verify_commitment
from taxel.blind.world import World
from taxel.input_files import parse_json, read_regular_file
from taxel.input_files.json_text import JSON_BYTES_MAX
from taxel.output import write_whole

SEALED: Final = "sealed"
COMMITMENTS, KEYS, WORLDS = "commitments.json", f"{SEALED}/keys.json", "worlds"


def get_world_folder(out: Path, world: World) -> Path:
    """Return the folder of a world's datasets and reports. out: folder of the blind check."""
    return out / WORLDS / f"{world.number:04d}"


def get_reference_path(out: Path, world: World) -> Path:
    """Return the file of a world's reference parameters, the true values that are fitted to noise-free data.

    The file is not in the folder of the world: only some kinds of worlds have such a file, and its existence would
    therefore reveal the kind.
    """
    return out / SEALED / f"reference{world.number:04d}.json"


def seal_worlds(out: Path, count: int, full_hand: int, seed: int | None) -> list[World]:
    """Sample worlds with hidden causes, publish their commitments (hashes) and store their keys in the folder `out`.

    count, full_hand: number of worlds with the rig of four boards and with the whole hand. seed: None: random numbers
    of the operating system. For an interrupted check in the folder, returns its worlds instead. Raises BlindRunError if
    the folder contains something else, SealBrokenError if its keys were modified.
    """
    keys = out / KEYS
    if keys.exists():
        worlds = open_sealed_worlds(out)
        found_full_hand = sum(world.hand != "rig4" for world in worlds)
        found = (len(worlds) - found_full_hand, found_full_hand)
        if found != (count, full_hand):
            expected_text, found_text = (
                f"{number} worlds and {full} of the full hand" for number, full in ((count, full_hand), found)
            )
            raise BlindRunError(str(out), expected_text, found_text, "choose another --out")
        return worlds
    if out.exists() and not _is_unused(out):
        expected = "an empty folder or an interrupted blind check"
        raise BlindRunError(str(out), expected, "other files", "choose another --out")
    worlds = sample_worlds(count, full_hand, seed)
    published = {str(world.number): commitment(world.to_json()) for world in worlds}
    write_whole(out / COMMITMENTS, json.dumps(published, indent=0))
    # The keys are written last: a folder without keys is no interrupted check.
    write_whole(keys, json.dumps([world.to_json() for world in worlds]), mode=0o600)
    return worlds


def _is_unused(out: Path) -> bool:
    """Whether a folder contains at most what a check leaves that was interrupted before its keys were stored."""
    own = {COMMITMENTS, f".{COMMITMENTS}.part", f".{Path(KEYS).name}.part"}
    return out.is_dir() and all(path.name in own for path in out.rglob("*") if not path.is_dir())


def open_sealed_worlds(out: Path) -> list[World]:
    """Read the worlds of a blind check, each verified against its commitment. Raises SealBrokenError, BlindRunError."""
    if not (out / KEYS).exists():
        raise BlindRunError(str(out), "a blind check", "none", "run `taxel gap blind` with --worlds first")
    committed, keys = read_json(out / COMMITMENTS), read_json(out / KEYS)
    remedy = "run the check again in another folder"
    try:
        for key in keys:
            verify_commitment(int(key["number"]), key, str(committed.get(str(key["number"]), "")))
        numbers = [key["number"] for key in keys]
        worlds = [World.from_json(key) for key in keys]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise BlindRunError(str(out / KEYS), "a list of keys", f"{type(error).__name__}: {error}", remedy) from None
    if len(keys) != len(committed) or numbers != sorted(set(numbers)):
        raise BlindRunError(str(out / KEYS), f"{len(committed)} keys", str(len(keys)), remedy)
    return worlds


def read_json(path: Path) -> Any:
    """Read a JSON file of a blind check. Raises BlindRunError if the file is missing or damaged."""
    try:
        return parse_json(read_regular_file(path, JSON_BYTES_MAX))
    except (OSError, ValueError) as error:
        remedy = "run the check again in another folder"
        raise BlindRunError(str(path), "readable JSON", str(error), remedy) from None
