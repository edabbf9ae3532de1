"""What the tests of generated grasps share: a small recipe, made once without a cut."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from taxel.generate.recipe import Recipe
from taxel.generate.run import generate
from taxel.generate.workers import Processes

SMALL = Recipe(grasps=5, seed=3, shard=2)


class Whole(NamedTuple):
    """A folder that was made in one go."""

    recipe: Recipe
    folder: Path


@pytest.fixture(scope="session")
def whole(tmp_path_factory) -> Whole:
    folder = tmp_path_factory.mktemp("generated") / "whole"
    assert generate(SMALL, folder, Processes(1)).made == 5
    return Whole(SMALL, folder)


def files(folder: Path) -> dict[str, bytes]:
    """All files of a folder, hidden ones too."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="session")
def files_of():
    return files
