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
    seal_worlds(tmp_path / "check", 4, 0, seed=1)
    return tmp_path / "check"


def change_keys(out, change):
    keys = json.loads((out / KEYS).read_text())
    change(keys)
    (out / KEYS).write_text(json.dumps(keys))


def test_sealing_publishes_commitments_and_no_dataset(out):
    assert {path.name for path in out.iterdir()} == {"commitments.json", "sealed"}
    assert [path.name for path in (out / "sealed").iterdir()] == ["keys.json"]
    assert (out / KEYS).stat().st_mode & 0o077 == 0


def test_commitments_are_written_before_the_keys(tmp_path, monkeypatch):
    def interrupt(path, data, mode=0o666):
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


def test_a_commitment_is_the_sha256_of_the_whole_key(out):
    published = json.loads((out / COMMITMENTS).read_text())
    for key in json.loads((out / KEYS).read_text()):
        text = json.dumps(key, sort_keys=True, separators=(",", ":"))
        assert published[str(key["number"])] == hashlib.sha256(text.encode()).hexdigest()
        verify_commitment(key["number"], key, commitment(key))


def test_every_salt_has_256_random_bits():
    salts = [world.salt for world in sample_worlds(40)]
    assert all(len(bytes.fromhex(salt)) == 32 for salt in salts)
    assert len(set(salts)) == 40


def test_opened_worlds_equal_the_sealed_ones(out):
    worlds = open_sealed_worlds(out)
    assert worlds == sample_worlds(4, 0, 1)
    assert [World.from_json(json.loads(json.dumps(world.to_json()))) for world in worlds] == worlds


@pytest.mark.parametrize("change", [
    lambda keys: keys[2].update(seed=keys[2]["seed"] + 1),
    lambda keys: keys[2]["hidden"].update(kind="outside"),
    lambda keys: keys[2]["hidden"]["nuisances"].reverse(),
    lambda keys: keys[2].update(salt="00" * 32),
    lambda keys: keys[2].update(withheld=not keys[2]["withheld"]),
])  # fmt: skip
def test_a_changed_key_is_rejected_in_one_line(out, change):
    change_keys(out, change)
    with pytest.raises(SealBrokenError) as caught:
        open_sealed_worlds(out)
    assert str(caught.value).startswith("world 2: the key does not match its commitment")
    assert "\n" not in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    with pytest.raises(SealBrokenError):  # a resumed check verifies the keys before it makes datasets
        seal_worlds(out, 4, 0, None)


def test_missing_or_unreadable_keys_are_rejected_in_one_line(out):
    change_keys(out, lambda keys: keys.pop())
    with pytest.raises(BlindRunError, match="expected 4 keys, found 3; run the check again") as caught:
        open_sealed_worlds(out)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    (out / KEYS).write_text("[")
    with pytest.raises(BlindRunError, match="expected readable JSON"):
        open_sealed_worlds(out)


def test_a_folder_of_another_check_is_rejected_in_one_line(out, tmp_path):
    with pytest.raises(BlindRunError, match="expected 5 worlds and 0 of the full hand, found 4 worlds and 0"):
        seal_worlds(out, 5, 0, None)
    with pytest.raises(BlindRunError, match="expected 3 worlds and 1 of the full hand"):
        seal_worlds(out, 3, 1, None)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").write_text("")
    with pytest.raises(BlindRunError, match="expected an empty folder or an interrupted blind check"):
        seal_worlds(tmp_path / "other", 4, 0, None)
    with pytest.raises(BlindRunError, match="expected a blind check, found none"):
        open_sealed_worlds(tmp_path / "other")
