"""Proposal of a mapping from the contents of a file; the user corrects the lines that are marked as a guess."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from dataclasses import dataclass
from math import isqrt, prod
from typing import Final

from taxel.recording.general.format import AXES
from taxel.recording.importers.fields import Field, Source
from taxel.recording.importers.mapping import FORMAT, VERSION
from taxel.recording.importers.selection import find_numbered
from taxel.recording.importers.times import find_time, guess_unit, is_increasing, rank_time_name

_LABEL_NAMES: Final = {
    "grasp": r"episode(_index|_id)?|grasp(_id|_index)?|contact(_id|_index)?|press(_id)?|trial(_id)?|indentation",
    "session": r"sessions?(_id|_index)?|day",
    "object": r"objects?(_name)?|task|shape",
    "approach": r"approach(es)?|direction|pose_name|places?|locations?|conditions?",
    "phase": r"phases?",
    "valid": r"valid|is_valid",
}
"""Regular expression of the field names for each label. Names are compared in lower case, without folder or topic."""

_COUNTERS: Final = re.compile(r"(frame|step|sample|row|task)(_?(index|id|number))?|index|seq(uence)?", re.IGNORECASE)
_LEAST_TAXELS: Final = 2


@dataclass(frozen=True)
class _Guess:
    """A guess which fields contain the taxel values.

    lines: lines of the table [values] of the mapping. frames: number of frames. width: number of taxels. names: fields
    with the values. shape: shape of a frame without components; empty for columns. components: number of values of each
    taxel. is_batch: whether the first axis of the array is the contact and the second the frame.
    """

    lines: tuple[str, ...]
    frames: int
    width: int
    names: tuple[str, ...]
    shape: tuple[int, ...] = ()
    components: int = 1
    is_batch: bool = False


def propose_mapping(source: Source) -> str:
    """Return the text of a mapping file (TOML) for a file. A comment marks each guess.

    Raises DatasetError for a file without an array that can be the values of taxels.
    """
    labels = _find_labels(source)
    time = _find_table_time(source) if source.is_table else None
    guess = _guess_values(source, {*labels.values(), *([time.name] if time is not None else [])})
    if guess is None:
        remedy = "write the mapping by hand, see docs/import-any-data.md"
        source.location.fail("an array [frame, taxel], or numbered columns", "neither", remedy)
    if guess.is_batch:
        names = ("session", "object", "approach")
        labels = {name: field for name, field in labels.items() if name in names}
    if time is None:
        time = find_time(source, guess.frames, guess.names[0])
    lines = [
        f"# Mapping for {source.path.name} ({source.kind}). Lines with GUESS need a check.",
        f"format = {_quote(FORMAT)}",
        f"version = {VERSION}",
        'source = "real"          # GUESS: "real" for measured data, "sim" for simulated data',
        '# unit = "N"             # unit of the values',
        '# contact = "raises"     # change of a value by contact: raises, lowers or signed; default: inferred',
        "# full_scale = 10.0      # largest change of a value by contact, in the unit",
        "# resolution = 0.01      # smallest step between two values, in the unit",
        '# modality = "other"     # capacitive, resistive, magnetic, barometric, optical or other',
        *_label_lines(labels),
        "",
        *_time_lines(time),
        "",
        "[values]                 # GUESS: the widest numeric array, or the largest set of numbered columns",
        *guess.lines,
        "",
        *_grasp_lines(labels, guess),
        "",
        *_position_lines(guess),
    ]
    return "\n".join(lines) + "\n"


def _quote(text: str) -> str:
    """Return a text as a TOML string."""
    return json.dumps(text, ensure_ascii=False)


def _find_labels(source: Source) -> dict[str, str]:
    """Return the name of the field of each label (key of `_LABEL_NAMES`) that the file contains."""
    result = {}
    for label, pattern in _LABEL_NAMES.items():
        for field in source.fields.values():
            name = re.split(r"[/:]", field.name)[-1].lower()
            is_column = len(field.shape) == 1 or field.shape[1:] == (1,)
            is_usable = is_column and label not in result and (label != "session" or field.is_numeric)
            if is_usable and re.fullmatch(pattern, name):
                result[label] = field.name
    return result


def _find_table_time(source: Source) -> Field | None:
    """Return the column of a table that is most probably the time; None if there is none.

    A column whose name is no name of a time is selected only if it is the first one, increases, and is no counter.
    """
    rows = next(iter(source.fields.values())).shape[0]
    named = [field for field in source.fields.values() if rank_time_name(field.name) < 4]  # 4: no pattern matches
    found = find_time(source, rows, candidates=named)
    if found is not None:
        return found
    first = next(iter(source.fields.values()))
    is_time = first.is_numeric and len(first.shape) == 1 and not _COUNTERS.fullmatch(first.name)
    return first if is_time and is_increasing(first.load()) and len(source.fields) > 1 else None


def _guess_values(source: Source, used: set[str]) -> _Guess | None:
    """Return the guess with the most taxels: an array [frame, ...], or a set of columns; None if there is none.

    used: fields that are times or labels.
    """
    guesses = [
        _guess_array(source, field, used)
        for field in source.fields.values()
        if field.is_numeric and len(field.shape) > 1 and field.name not in used and prod(field.shape[1:]) > 1
    ]
    if source.is_table:
        guesses += _guess_columns(source, used)
    return max(guesses, key=lambda guess: guess.width, default=None)


def _guess_array(source: Source, field: Field, used: set[str]) -> _Guess:
    """Return the guess that the array `field` contains the taxel values.

    The first axis is the contact if the file has no times for this axis, and a one-dimensional field has as many
    entries as the second axis. used: fields that are labels and therefore no times.
    """
    lengths = {other.shape[0] for other in source.fields.values() if len(other.shape) == 1}
    times = [other for other in source.fields.values() if other.name not in {*used, field.name}]
    has_times = find_time(source, field.shape[0], candidates=times) is not None
    is_batch = len(field.shape) > 2 and not has_times and field.shape[1] in lengths
    shape = field.shape[2:] if is_batch else field.shape[1:]
    components = AXES if len(shape) > 1 and shape[-1] == AXES else 1
    lines = [f"field = {_quote(field.name)}"]
    if components == AXES:
        lines += ["components = 3           # GUESS: the last axis has 3 components"]
        shape = shape[:-1]
    frames = field.shape[1] if is_batch else field.shape[0]
    return _Guess(tuple(lines), frames, prod(shape), (field.name,), shape, components, is_batch)


def _guess_columns(source: Source, used: set[str]) -> list[_Guess]:
    """Return the guesses that columns of a table contain the taxel values: one guess for each set of numbered columns.

    Without numbered columns, the only guess is all other numeric columns. used: columns that are times or labels.
    """
    free = [
        field.name
        for field in source.fields.values()
        if field.is_numeric and len(field.shape) == 1 and field.name not in used and not _COUNTERS.fullmatch(field.name)
    ]
    groups: dict[str, list[str]] = defaultdict(list)
    for name in free:
        match = re.fullmatch(r"(.*?)\d+", name)
        if match is not None:
            groups[match[1]].append(name)
    rows = next(iter(source.fields.values())).shape[0]
    guesses = []
    for prefix, names in groups.items():
        if len(names) < _LEAST_TAXELS:
            continue
        line = f"prefix = {_quote(prefix)}"
        if set(find_numbered(source, prefix)) != set(names):
            line = f"range = [{_quote(names[0])}, {_quote(names[-1])}]"
        guesses.append(_Guess((line,), rows, len(names), tuple(names)))
    if not guesses and len(free) >= _LEAST_TAXELS:
        lines = [f"columns = [{', '.join(_quote(name) for name in free)}]"]
        is_vector = len(free) % AXES == 0 and all(
            name.lower().endswith("xyz"[index % AXES]) for index, name in enumerate(free)
        )
        if is_vector:
            lines += ["components = 3           # GUESS: the names end with x, y and z"]
        guesses.append(_Guess(tuple(lines), rows, len(free), tuple(free), (), AXES if is_vector else 1))
    return guesses


def _time_lines(time: Field | None) -> list[str]:
    """Return the lines of the table [time] of a mapping. time: field of the times; None: a rate is proposed."""
    if time is None:
        return ["[time]                   # GUESS: the file has no increasing times", "rate_hz = 100.0"]
    unit = guess_unit(time.name, time.load())
    return ["[time]                   # GUESS", f"field = {_quote(time.name)}", f"unit = {_quote(unit)}"]


def _label_lines(labels: dict[str, str]) -> list[str]:
    """Return the lines of a mapping for session, object, approach, phase and valid.

    labels: name of the field by the name of the label. A label without a field gets a constant or a comment.
    """
    lines = []
    defaults = {
        "session": "session = 1              # GUESS: number of the day or of the mounting",
        "object": '# object = "cylinder"    # label; contacts with equal labels are repeats',
        "approach": '# approach = "top"       # label',
    }
    for name in ("session", "object", "approach"):
        field = labels.get(name)
        lines.append(f"{name} = {{ field = {_quote(field)} }}  # GUESS" if field is not None else defaults[name])
    for name in ("phase", "valid"):
        if name in labels:
            lines.append(f"{name} = {_quote(labels[name])}  # GUESS")
    return lines


def _grasp_lines(labels: dict[str, str], guess: _Guess) -> list[str]:
    """Return the lines of the table [grasp] of a mapping, which divides the frames into contacts."""
    if guess.is_batch:
        return ["[grasp]", "axis = true              # GUESS: the first axis is the contact, the second the frame"]
    if "grasp" in labels:
        return ["[grasp]", f"field = {_quote(labels['grasp'])}  # GUESS: number of the contact of each frame"]
    return ["[grasp]                  # GUESS: the file contains one contact", "# gap_s = 1.0            # or: a pause"]


def _position_lines(guess: _Guess) -> list[str]:
    """Return the lines of the table [positions] of a mapping, as comments.

    A grid is proposed for a frame of two axes, and for a square number of taxels.
    """
    shape = guess.shape
    side = isqrt(guess.width)
    if len(shape) != 2 and side * side == guess.width and side > 1:
        shape = (side, side)
    if len(shape) != 2:
        return ["# [positions]            # or: field = ..., unit = m or mm", "# rows, columns, pitch_mm of a grid"]
    grid = [f"# rows = {shape[0]}", f"# columns = {shape[1]}", "# pitch_mm = 5.0         # distance of the taxels"]
    return ["# [positions]            # GUESS: a grid; remove the # and correct the pitch", *grid]
