"""A small recipe that is generated once without interruption."""

from pathlib import Path
from typing import NamedTuple

import pytest

from taxel.generate.recipe import Recipe
from taxel.generate.run import generate
from taxel.generate.workers import Processes

SMALL = Recipe(grasps=5, seed=3, grasps_per_shard=2)


class GeneratedFolder(NamedTuple):
    """A folder that was generated in one run."""

    recipe: Recipe
    folder: Path


@pytest.fixture(scope="session")
def generated(tmp_path_factory) -> GeneratedFolder:
    folder = tmp_path_factory.mktemp("generated") / "complete"
    assert generate(SMALL, folder, Processes(1)).made == 5
    return GeneratedFolder(SMALL, folder)


def files(folder: Path) -> dict[str, bytes]:
    """Contents of all files of a folder by name, including hidden ones."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="session")
def files_of():
    return files
