"""The seal: causes are committed to before the datasets are made, and later changes are detected."""

import hashlib
import json
import pickle

import pytest

from taxel.blind.errors import BlindRunError
from taxel.blind.run_folder import COMMITMENTS, KEYS, open_sealed_worlds, seal_worlds
from taxel.blind.sampling import sample_worlds
from taxel.blind.seal import SealBrokenError, commitment, verify_commitment
from taxel.blind.world import World
from taxel.output import write_whole


@pytest.fixture
def out(tmp_path):
    """Seal four worlds; return the folder of the check."""
    seal_worlds(tmp_path / "check", 4, 0, seed=1)
    return tmp_path / "check"


def change_keys(out, change):
    """Apply a function to the stored keys of a check."""
    keys = json.loads((out / KEYS).read_text())
    change(keys)
    (out / KEYS).write_text(json.dumps(keys))


def test_sealing_writes_only_commitments_and_keys_that_only_the_owner_can_read(out):
    assert {path.name for path in out.iterdir()} == {"commitments.json", "sealed"}
    assert [path.name for path in (out / "sealed").iterdir()] == ["keys.json"]
    assert (out / KEYS).stat().st_mode & 0o077 == 0


def test_interruption_between_commitments_and_keys_leaves_a_folder_that_can_be_used_again(tmp_path, monkeypatch):
    def interrupt(path, data, mode=0o666):
        """Write a file, but interrupt before the keys are written."""
        if path.name == "keys.json":
            raise KeyboardInterrupt
        write_whole(path, data, mode=mode)

    monkeypatch.setattr("taxel.blind.run_folder.write_whole", interrupt)
    with pytest.raises(KeyboardInterrupt):
        seal_worlds(tmp_path / "check", 2, 0, None)
    assert len(json.loads((tmp_path / "check" / COMMITMENTS).read_text())) == 2
    assert not (tmp_path / "check" / KEYS).exists()
    monkeypatch.undo()
    assert len(seal_worlds(tmp_path / "check", 2, 0, None)) == 2, "the folder of the interrupted check was refused"


def test_commitment_is_the_sha256_of_the_whole_key(out):
    published = json.loads((out / COMMITMENTS).read_text())
    for key in json.loads((out / KEYS).read_text()):
        text = json.dumps(key, sort_keys=True, separators=(",", ":"))
        assert published[str(key["number"])] == hashlib.sha256(text.encode()).hexdigest()
        verify_commitment(key["number"], key, commitment(key))


def test_every_salt_has_256_random_bits():
    salts = [world.salt for world in sample_worlds(40)]
    assert all(len(bytes.fromhex(salt)) == 32 for salt in salts)
    assert len(set(salts)) == 40


def test_opened_worlds_equal_the_sealed_worlds(out):
    assert open_sealed_worlds(out) == sample_worlds(4, 0, 1)


def test_worlds_are_restored_from_json():
    worlds = sample_worlds(4, 0, 1)
    assert [World.from_json(json.loads(json.dumps(world.to_json()))) for world in worlds] == worlds


@pytest.mark.parametrize("change", [
    lambda keys: keys[2].update(seed=keys[2]["seed"] + 1),
    lambda keys: keys[2]["hidden"].update(kind="outside"),
    lambda keys: keys[2]["hidden"]["nuisances"].reverse(),
    lambda keys: keys[2].update(salt="00" * 32),
    lambda keys: keys[2].update(withheld=not keys[2]["withheld"]),
])  # fmt: skip
def test_changed_key_is_rejected_in_one_line_when_worlds_are_opened(out, change):
    change_keys(out, change)
    with pytest.raises(SealBrokenError) as caught:
        open_sealed_worlds(out)
    assert str(caught.value).startswith("world 2: the key does not match its commitment")
    assert "\n" not in str(caught.value)


def test_changed_key_is_rejected_when_a_check_is_resumed(out):
    change_keys(out, lambda keys: keys[2].update(salt="00" * 32))
    with pytest.raises(SealBrokenError):
        seal_worlds(out, 4, 0, None)


@pytest.mark.parametrize(
    "error", [SealBrokenError(2), BlindRunError("keys.json", "4 keys", "3", "run the check again")], ids=["seal", "run"]
)
def test_errors_keep_their_message_between_processes(error):
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_missing_key_is_rejected(out):
    change_keys(out, lambda keys: keys.pop())
    with pytest.raises(BlindRunError, match="expected 4 keys, found 3; run the check again"):
        open_sealed_worlds(out)


def test_damaged_file_of_keys_is_rejected(out):
    (out / KEYS).write_text("[")
    with pytest.raises(BlindRunError, match="expected readable JSON"):
        open_sealed_worlds(out)


def test_folder_with_another_number_of_worlds_is_rejected(out):
    with pytest.raises(BlindRunError, match="expected 5 worlds and 0 of the full hand, found 4 worlds and 0"):
        seal_worlds(out, 5, 0, None)
    with pytest.raises(BlindRunError, match="expected 3 worlds and 1 of the full hand"):
        seal_worlds(out, 3, 1, None)


def test_folder_with_other_files_is_rejected(tmp_path):
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(BlindRunError, match="expected an empty folder or an interrupted blind check"):
        seal_worlds(tmp_path, 4, 0, None)
    with pytest.raises(BlindRunError, match="expected a blind check, found none"):
        open_sealed_worlds(tmp_path)
