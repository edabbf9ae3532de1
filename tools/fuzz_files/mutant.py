"""Mutants: the files of one input, made from valid files by a numbered random mutation."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from random import Random
from typing import Any, Final

import numpy as np

from fuzz_files.byte_mutation import mutate_bytes
from fuzz_files.codec import Codec
from fuzz_files.document import Flat, flatten, list_differences
from fuzz_files.oracle import Change
from fuzz_files.target import Files, Target
from fuzz_files.tree_mutation import mutate_tree

_BYTES_SHARE: Final = 0.35
"""Share of the mutants whose bytes are mutated although the file has a model."""

_ATTEMPTS: Final = 20


@dataclass(frozen=True)
class Mutant:
    """A mutated input. name: the mutated file. description: the mutation. files: all files of the input."""

    name: str
    description: str
    files: Files


class MutantMaker:
    """Maker of one target's mutants, from its valid files."""

    def __init__(self, target: Target, files: Files) -> None:
        """Decode the valid files with the codecs of the target. files: bytes by name."""
        self._target = target
        self._files = files
        self._names = [name for name in sorted(files) if re.search(target.mutable, name)]
        self._documents: dict[tuple[str, int], Any] = {}
        self._flat: dict[str, Flat | None] = {}
        for name in self._names:
            for index, codec in enumerate(target.find_codecs(name)):
                self._documents[name, index] = codec.decode(files[name])
            model = self._documents.get((name, 0))
            self._flat[name] = None if model is None else flatten(model)

    def make(self, seed: int, number: int) -> Mutant:
        """Return mutant `number`; equal arguments give equal mutants.

        The mutation changes fields of the decoded file or, with a probability of at least `_BYTES_SHARE`, its bytes. In
        a file without a codec it always changes bytes.
        """
        random = Random(f"{seed} {self._target.name} {number}")
        name = random.choice(self._names)
        codecs = self._target.find_codecs(name)
        if codecs and random.random() > _BYTES_SHARE:
            for _ in range(_ATTEMPTS):
                index = random.randrange(len(codecs))
                changed = self._mutate_fields(name, index, codecs[index], random)
                if changed is not None:
                    return changed
        data, description = mutate_bytes(self._files[name], random)
        return Mutant(name, description, {**self._files, name: data})

    def _mutate_fields(self, name: str, index: int, codec: Codec, random: Random) -> Mutant | None:
        """Return a mutant of the file `name` with changed fields; None if the codec cannot encode the changed document.

        index: number of the codec among those of the file.
        """
        try:
            document, description = mutate_tree(self._documents[name, index], random)
            data = codec.encode(document)
        except Exception:  # a document that the format cannot express; another mutation is tried
            return None
        return Mutant(name, f"{type(codec).__name__}: {description}", {**self._files, name: data})

    def describe_change(self, mutant: Mutant) -> Change:
        """Return which fields of the file a mutation has changed.

        The result states no fields if the file has no codec or the codec cannot decode the mutant. If the codec is
        strict, its error means that the file is not valid, so the reader must refuse the mutant.
        """
        codecs, before = self._target.find_codecs(mutant.name), self._flat[mutant.name]
        if not codecs or before is None:
            return Change()
        try:
            after = flatten(codecs[0].decode(mutant.files[mutant.name]))
        except RecursionError:
            return Change()
        except Exception:  # the libraries that decode a damaged file raise errors of many types
            return Change(must_be_refused=codecs[0].is_strict)
        paths = list_differences(before, after)
        equivalent = frozenset(path for path in paths if _is_same(before, after, path))
        is_reordered = _list_values(before, paths) == _list_values(after, paths)
        return Change(
            after, tuple(paths), equivalent, is_reordered=is_reordered, moved=find_moved(before, after, paths)
        )


def _is_same(before: Flat, after: Flat, path: str) -> bool:
    """Return whether the values at a path mean the same although their types or texts differ.

    This holds for equal numbers in strings (0.5 and .50), for strings that differ only in white space, and for a number
    and an array that contains only this number.
    """
    own, other = before.get(path), after.get(path)
    if isinstance(other, np.ndarray) and other.size == 1 and other.dtype.kind in "iuf" and isinstance(own, int | float):
        return bool(other.reshape(-1)[0] == own)
    if not (isinstance(own, str) and isinstance(other, str)):
        return False
    try:
        return float(own) == float(other)
    except ValueError:
        return own.split() == other.split()


def find_moved(before: Flat, after: Flat, paths: list[str]) -> frozenset[str]:
    """Return the paths whose values have only moved between the elements of a list.

    paths: changed fields. Example: `boards[0].name` has moved if another changed field `boards[...].name` had its
    present value before the change.
    """
    former: dict[str, Counter[str]] = {}
    for path in paths:
        if path in before:
            former.setdefault(_remove_indices(path), Counter())[repr(before[path])] += 1
    moved = []
    for path in paths:
        values = former.get(_remove_indices(path), Counter())
        if path in after and values[repr(after[path])] > 0:
            values[repr(after[path])] -= 1
            moved.append(path)
    return frozenset(moved)


def _remove_indices(path: str) -> str:
    """Return a path without the numbers of the elements: `boards[].name`."""
    return re.sub(r"\[\d+\]", "[]", path)


def _list_values(fields: Flat, paths: list[str]) -> list[str]:
    """Return the sorted representations of the values of fields, independent of their paths."""
    return sorted(repr(fields[path]) for path in paths if path in fields)


def list_sizes(files: Mapping[str, bytes]) -> str:
    """Return the names and sizes of an input's files as a text."""
    return ", ".join(f"{name} ({len(data)} bytes)" for name, data in files.items())
