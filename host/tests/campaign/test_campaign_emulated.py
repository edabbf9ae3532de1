"""A campaign on the emulated hand: parallel, interrupted and resumed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from taxel.campaign.emulated import run_emulated
from taxel.campaign.point_counts import count_contact_points
from taxel.campaign.processes import ProcessLostError, map_in_processes
from taxel.campaign.settings import EmulatedSettings
from taxel.emulated.contact import ContactLibraryError
from taxel.errors import TaxelError
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_dataset import GraspDataset

TIMEOUT_S = 60.0

INTERRUPTED_PROGRAM = """
import os, signal, sys
from taxel.campaign.emulated import run_emulated
from taxel.campaign.settings import EmulatedSettings
from taxel.grasp.plan import PlannedGrasp
from taxel.grasp.timeline import Timeline

def show(done, of):
    if done == 1:
        print("first grasp", flush=True)
        os.kill(os.getpid(), signal.SIGKILL)

run_emulated(sys.argv[1], {plan}, EmulatedSettings(timeline={timeline}), jobs=1, progress=show)
"""


def read_content(path) -> dict[str, object]:
    """Read the datasets and attributes of a file, by name, without the creation time and the content of strings."""
    items: dict[str, object] = {}

    def visit(name: str, item) -> None:
        """Add the attributes and the values of one item of the file to `items`."""
        items.update({f"{name}@{key}": str(value) for key, value in item.attrs.items() if key != "created"})
        if isinstance(item, h5py.Dataset):
            items[name] = (item.dtype.str, item.shape, np.asarray(item[()]).tobytes() if item.dtype.kind != "O" else 0)

    with h5py.File(path, "r") as file:
        visit("", file)
        file.visititems(visit)
    return items


@pytest.fixture(scope="module")
def settings(timeline):
    return EmulatedSettings(timeline=timeline)


@pytest.fixture(scope="module")
def complete_campaign(setup, plan, settings, tmp_path_factory):
    """Run a campaign of both sessions in one process; return the path of its dataset and the reported progress."""
    path, progress = tmp_path_factory.mktemp("complete") / "real.h5", []
    run_emulated(path, plan, settings, setup, jobs=1, progress=lambda *counts: progress.append(counts))
    return path, progress


def test_the_file_is_a_real_dataset_of_the_plan_and_progress_is_reported(complete_campaign, plan, setup):
    path, progress = complete_campaign
    with GraspDataset(path) as data:
        data.check()
        assert (data.source, data.hand) == ("real", "original")
        assert data.ids == tuple(planned.id for planned in plan)
        assert [grasp.session for grasp in data] == [0, 1]
        assert (data.taxels.position == setup.hand.position).all()
    assert progress == [(0, 2), (1, 2), (2, 2)]


def test_only_the_grasped_object_has_contact_points(complete_campaign):
    counted = count_contact_points(complete_campaign[0])
    assert counted["cylinder"].grasps == 2
    assert counted["cylinder"].points > 20
    assert counted["rectangular_prism"] == counted["triangular_prism"]
    assert counted["rectangular_prism"].grasps == counted["rectangular_prism"].points == 0


@pytest.mark.slow
def test_one_and_two_processes_make_files_with_the_same_content(complete_campaign, plan, settings, tmp_path):
    run_emulated(tmp_path / "real.h5", plan, settings, jobs=2)
    assert read_content(tmp_path / "real.h5") == read_content(complete_campaign[0])


def test_a_killed_campaign_leaves_a_valid_file_and_resumes_to_the_same_content(
    complete_campaign, plan, settings, setup, timeline, tmp_path
):
    path, progress = tmp_path / "real.h5", []
    code = "from taxel.grasp.timeline import Timeline\n" + INTERRUPTED_PROGRAM.format(
        plan=f"({format_plan(plan)})", timeline=repr(timeline)
    )
    result = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, timeout=TIMEOUT_S, check=False
    )
    assert result.stdout == b"first grasp\n"
    assert result.returncode != 0
    with GraspDataset(path) as data:
        data.check()
        assert data.ids == (plan[0].id,)
    run_emulated(path, plan, settings, setup, jobs=1, resume=True, progress=lambda *counts: progress.append(counts))
    assert read_content(path) == read_content(complete_campaign[0])
    assert progress == [(1, 2), (2, 2)]
    resumed_content = path.read_bytes()
    run_emulated(path, plan, settings, setup, resume=True)
    assert path.read_bytes() == resumed_content


def format_plan(plan) -> str:
    """Format the grasps of a plan as Python source."""
    return "".join(
        f"PlannedGrasp({item.id!r}, {item.object!r}, {item.approach!r}, {item.iteration}, {item.session}), "
        for item in plan
    )


def test_an_existing_file_is_rejected_before_the_campaign_starts(complete_campaign, plan, settings, setup):
    earlier_content = complete_campaign[0].read_bytes()
    with pytest.raises(DatasetError, match=r"real\.h5"):
        run_emulated(complete_campaign[0], plan, settings, setup, progress=_fail_on_progress)
    assert complete_campaign[0].read_bytes() == earlier_content


def test_a_file_made_with_other_settings_is_not_resumed(complete_campaign, plan, timeline, setup):
    settings = EmulatedSettings(seed=2, timeline=timeline)
    with pytest.raises(DatasetError, match="another campaign") as caught:
        run_emulated(complete_campaign[0], plan, settings, setup, resume=True, progress=_fail_on_progress)
    assert "\n" not in str(caught.value)


def test_effects_rejected_by_the_emulator_create_no_file_and_replace_none(plan, timeline, setup, tmp_path):
    settings, path = EmulatedSettings(timeline=timeline, effects=("noise purple",)), tmp_path / "real.h5"
    with pytest.raises(ContactLibraryError, match="noise purple"):
        run_emulated(path, plan, settings, setup)
    assert not path.exists()
    path.write_text("kept")
    with pytest.raises(ContactLibraryError):
        run_emulated(path, plan, settings, setup, overwrite=True)
    assert path.read_text() == "kept"


def _fail_on_progress(done: int, total: int) -> None:
    raise AssertionError("the campaign started")


def kill_process(setup, part: int, settings: bytes) -> int:
    """Kill the worker process at part 1; return any other part."""
    if part == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return part


def touch_file(setup, part: int, folder: str) -> int:
    """Create a file with the number of the part as its name, so that the test can count the processed parts."""
    time.sleep(0.02)
    Path(folder, str(part)).touch()
    return part


def raise_error(setup, part: int, settings: None) -> int:
    raise TaxelError(f"part {part}")


def test_a_killed_worker_process_raises_an_error_with_a_one_line_message(setup):
    """The settings are larger than the buffer of a pipe, 64 KiB: a task of this size would block the pool for ever."""
    with pytest.raises(ProcessLostError, match="continue with resume") as caught:
        list(map_in_processes(kill_process, setup, [0, 1, 2, 3], bytes(1 << 20), 2))
    assert "\n" not in str(caught.value)


def test_an_error_in_a_worker_process_is_raised_in_the_caller(setup):
    with pytest.raises(TaxelError, match="part 0"):
        list(map_in_processes(raise_error, setup, range(50), None, 2))


@pytest.mark.slow
def test_results_are_ordered_and_closing_the_iterator_cancels_the_remaining_parts(setup, tmp_path):
    results = map_in_processes(touch_file, setup, range(500), str(tmp_path), 2)
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    results.close()
    assert len(list(tmp_path.iterdir())) < 100  # each of the 500 parts would create a file
