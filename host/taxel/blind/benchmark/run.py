"""A resumable run of the benchmark: worlds are made, diagnosed by every entry (diagnosis program), and scored at the
end.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from taxel.blind.benchmark.entries import check_answer, load_entry
from taxel.blind.benchmark.scoring import ScoredAnswer, score_answers
from taxel.blind.benchmark.worlds import FAMILIES, BenchmarkWorld, sample_benchmark
from taxel.blind.injection.forms import INJECTED_FORMS, RESERVED_FORMS
from taxel.errors import TaxelError
from taxel.gap.fitting.parallel import open_diagnosis_pool
from taxel.output import AppendedLines, read_complete_lines, write_whole

ANSWERS, BASES = "answers.jsonl", "bases"
"""Names of the file of answers, and of the folder of datasets without a cause, in the folder of a run."""

WORLD_FIELDS: Final = ("gap", "truth", "kind")
"""Fields of a line of answers that describe the world as it was made: gap and floor in counts, causes, and kind."""


def run_benchmark(
    out: Path,
    count: int,
    seed: int,
    entries: Sequence[str],
    families: Sequence[str] = tuple(FAMILIES),
    jobs: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
    uses_reserved_forms: bool = False,
) -> dict[str, dict[str, Any]]:
    """Score diagnoses on `count` worlds; write the measures to `out`/score.json and return them by name of the
    diagnosis.

    out: folder of the run; answers of an interrupted run with the same seed, number and families are kept. entries:
    names of the diagnoses. families: names of the world families (keys of `FAMILIES`). jobs: number of processes; None:
    one per core. progress: called with the number of finished worlds and the total. uses_reserved_forms: whether
    injected causes have the `RESERVED_FORMS`. Raises TaxelError with a one-line message.
    """
    for name in entries:
        load_entry(name)
    out.mkdir(parents=True, exist_ok=True)
    run: dict[str, Any] = {"count": count, "seed": seed, "families": sorted(families)}
    if uses_reserved_forms:
        run["forms"] = "reserved"
    answers = _read_answers(out / ANSWERS, run)
    worlds = sample_benchmark(count, seed, families, RESERVED_FORMS if uses_reserved_forms else INJECTED_FORMS)
    todo = [world for world in worlds if set(entries) - set(answers.get(world.number, {}))]
    progress(count - len(todo), count)
    task = partial(diagnose_world, entries=tuple(entries), seed=seed, bases=out / BASES)
    with AppendedLines(out / ANSWERS) as file, open_diagnosis_pool(jobs, len(todo)) as pool:
        for done, (world, record) in enumerate(zip(todo, pool.map(task, todo), strict=True), count - len(todo) + 1):
            line = {"number": world.number, **run, **record}
            file.append(json.dumps(line))
            answers.setdefault(world.number, {}).update(record["entries"])
            answers[world.number] |= {name: record[name] for name in WORLD_FIELDS}
            progress(done, count)
    score = {name: _score_entry(name, worlds, answers) for name in entries}
    settings = {name: value for name, value in run.items() if name != "count"}
    write_whole(out / "score.json", json.dumps({"worlds": count, **settings, "score": score}, indent=1) + "\n")
    return score


def diagnose_world(world: BenchmarkWorld, entries: Sequence[str], seed: int, bases: Path) -> dict[str, Any]:
    """Make a world in a temporary folder and diagnose it with every entry (name of a diagnosis).

    bases: folder of the datasets without a cause. Returns under "gap" the gap and the floor of the world, or None if
    they cannot be measured, under "truth" and "kind" its causes and kind as made, and under "entries" for each name the
    probabilities, the run time in seconds and, if the diagnosis failed, its error.
    """
    from taxel.gap.data.pair import read_pair
    from taxel.gap.data.prepare import prepare_pair
    from taxel.gap.features.metric import measure_gap

    result: dict[str, Any] = {"gap": None, "entries": {}}
    with TemporaryDirectory(prefix="taxel-benchmark-") as name:
        real, sim = Path(name) / "real.h5", Path(name) / "sim.h5"
        made = world.without_weak_causes(world.make(real, sim, bases))
        result |= {"truth": list(made.truth), "kind": made.kind}
        try:
            fit_data = prepare_pair(read_pair(real, sim))
            gap = measure_gap(fit_data.sessions, fit_data.state.mean, fit_data.layout)
            result["gap"] = [gap.gap.value, gap.floor]
        except TaxelError:
            pass  # the diagnoses find the same error and report it
        for entry in entries:
            start = time.perf_counter()
            try:
                answer: dict[str, Any] = {"probabilities": check_answer(load_entry(entry)(real, sim, seed), entry)}
            except TaxelError as error:
                answer = {"probabilities": {}, "error": str(error)}
            result["entries"][entry] = {**answer, "seconds": round(time.perf_counter() - start, 2)}
    return result


def _read_answers(path: Path, run: Mapping[str, Any]) -> dict[int, dict[str, Any]]:
    """Read the answers of an interrupted run: by number of the world, the answers by name of the diagnosis and the gap.

    run: number of worlds, seed, families and forms that each line must state. Raises TaxelError for other values.
    """
    answers: dict[int, dict[str, Any]] = {}
    for number, text in enumerate(read_complete_lines(path), 1):
        try:
            line = json.loads(text)
            is_same = all(line[key] == run[key] for key in ("count", "seed", "families"))
            is_same = is_same and line.get("forms") == run.get("forms")  # absent: the forms of the calibration
            answer = {**line["entries"], **{name: line[name] for name in WORLD_FIELDS}}
        except (ValueError, KeyError, TypeError):
            raise TaxelError(
                f"{path}: line {number}: expected an answer; remove the file or choose another --out"
            ) from None
        if not is_same:
            raise TaxelError(
                f"{path}: the answers belong to another seed, number, family or forms of worlds; choose another --out"
            )
        answers.setdefault(line["number"], {}).update(answer)
    return answers


def _score_entry(name: str, worlds: Sequence[BenchmarkWorld], answers: dict[int, dict[str, Any]]) -> dict[str, Any]:
    """Compute the measures of one diagnosis over all worlds (key "all"), and for each family of worlds."""
    scored = []
    for world in worlds:
        answer, made = answers[world.number][name], answers[world.number]
        ratio = made["gap"][0] / max(made["gap"][1], 1e-9) if made["gap"] else 0.0
        truth, probabilities = frozenset(made["truth"]), answer["probabilities"]
        scored.append(ScoredAnswer(truth, made["kind"], world.family, probabilities, ratio, answer["seconds"]))
    families = sorted({one.family for one in scored})
    by_family = {family: score_answers([one for one in scored if one.family == family]) for family in families}
    return {"all": score_answers(scored), **by_family}
