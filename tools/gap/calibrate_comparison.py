"""Calibration of the comparison: fits the logistic models to the evidence of worlds with known causes.

python tools/gap/calibrate_comparison.py --out out/calibration --write

`calibration_evidence.py` collects and stores the evidence. --datasets: keep the datasets, so that a calibration after a
change of the comparison need not make them again. --stored: fit to stored evidence, without further worlds: that of
--out, or else that of the packaged calibration (`PACKAGED`). The worlds are those of `taxel gap benchmark` with this
seed, in random order, so that the stored part of a run has all families. The weights of the worlds give each family its
share in the benchmark (`compute_weights`).

Withheld effects: a world with one cause is compared twice, the second time without its effect in the catalogue. The
cause is then unknown, and the models use the evidence of effects that resemble it. The two comparisons together count
as one world (`WITHHELD_WEIGHT`). Withheld forms: the models are fitted to all worlds but those of some forms of causes
(a fold of `--folds`), and the printed scores refer to the forms that were left out. --packaged: print the scores of the
packaged calibration instead of a fit. --write: store the models fitted to all worlds in
host/taxel/gap/calibration/calibration.json, and the evidence in `PACKAGED`.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from calibration_evidence import (
    PACKAGED,
    WITHHELD_WEIGHT,
    Sample,
    describe_source,
    list_comparisons,
    read_stored,
    run,
    store_packaged,
)

from taxel.blind.benchmark.scoring import ScoredAnswer, score_answers
from taxel.blind.benchmark.worlds import FAMILIES, SENSOR_FAMILIES
from taxel.blind.hidden import UNKNOWN
from taxel.gap.calibration.calibration import (
    Calibration,
    Logistic,
    combine_inputs,
    compute_any_inputs,
    load_calibration,
)
from taxel.gap.comparison.evidence import EffectEvidence, RemainderEvidence
from taxel.output import write_whole
from taxel.types import FloatArray

TARGET = Path(__file__).resolve().parents[2] / "host" / "taxel" / "gap" / "calibration" / "calibration.json"


def fit(evidence: list[dict[str, Any]], source: str) -> Calibration:
    """Fit the logistic models of the calibration to the evidence of worlds with known causes.

    The models give the probabilities that an effect is a cause, that the cause is unknown, and that there is any cause.
    A tried effect that no candidate set contains has no inputs for a model: its probability is the share of true causes
    among such effects. Every world has the weight 1 in total. source: text that names the origin of the evidence.
    """
    weights = [one["weight"] for one in evidence]
    inputs: list[FloatArray] = []
    labels: list[bool] = []
    effect_weights: list[float] = []
    for one in evidence:
        effects, remainder, _ = get_inputs(one)
        inputs += [combine_inputs(values, remainder) for values in effects.values()]
        labels += [name in one["truth"] for name in effects]
        effect_weights += [one["weight"]] * len(effects)
    skipped = [name in one["truth"] for one in evidence for name in one["tried"] if name not in one["effects"]]
    effect = Logistic.fit(np.array(inputs), labels, effect_weights)
    remainders = np.array([get_inputs(one)[1] for one in evidence])
    unknown = Logistic.fit(remainders, [UNKNOWN in one["truth"] for one in evidence], weights)
    rate = (sum(skipped) + 0.5) / (len(skipped) + 1.0)  # Jeffreys' estimate
    alone = Calibration(effect, unknown, unknown, rate, source)  # without a model of any cause
    sizes = [compute_any_inputs(*get_inputs(one)[:2]) for one in evidence]
    any_cause = Logistic.fit(np.array(sizes), [bool(one["truth"]) for one in evidence], weights)
    return replace(alone, any_cause=any_cause)


def get_inputs(one: dict[str, Any]) -> tuple[dict[str, FloatArray], FloatArray, list[str]]:
    """Return the models' inputs from the stored evidence of one world.

    Returns inputs by effect, inputs of the remainder that no effect explains, and names of the effects that were tried.
    """
    effects = {name: EffectEvidence(**values).to_inputs() for name, values in one["effects"].items()}
    return effects, RemainderEvidence(**one["remainder"]).to_inputs(), one["tried"]


def predict(one: dict[str, Any], calibration: Calibration) -> dict[str, float]:
    """Return the probability of each cause of one world, from its stored evidence."""
    return calibration.compute_probabilities(*get_inputs(one))


def score_withheld(evidence: list[dict[str, Any]], folds: int, seed: int) -> dict[str, Any]:
    """Return the scores of a cross-validation over the forms of causes, by family of worlds and for all.

    A form is a functional variant of a cause (`BenchmarkWorld.forms`). The forms are divided randomly into `folds`
    folds. For each fold, the logistic models are fitted to the worlds that contain none of its forms (the withheld
    forms). The models then predict the probability of each cause in the worlds whose first cause has a withheld form,
    and the scores compare these probabilities with the true causes. Worlds without a cause are divided randomly among
    the folds. evidence: evidence of all worlds, from `run`.
    """
    rng = np.random.default_rng(seed)
    variants = sorted({variant for one in evidence for variant in one["forms"]})
    fold_of = dict(zip(variants, rng.permutation(len(variants)) % folds, strict=True))
    folds_of_worlds = [int(fold_of[one["forms"][0]]) if one["forms"] else int(rng.integers(folds)) for one in evidence]
    answers = []
    for number in range(folds):
        withheld = {variant for variant, fold in fold_of.items() if fold == number}
        rest = [
            one
            for one, fold in zip(evidence, folds_of_worlds, strict=True)
            if fold != number and not withheld & set(one["forms"])
        ]
        calibration = fit(rest, "")
        for one, fold in zip(evidence, folds_of_worlds, strict=True):
            if fold == number:
                answers.append(_answer(one, calibration))
    return _score_by_family(answers)


def score_packaged(evidence: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the scores of the packaged calibration, by family of worlds and for all."""
    calibration = load_calibration()
    return _score_by_family([_answer(one, calibration) for one in evidence])


def _answer(one: dict[str, Any], calibration: Calibration) -> ScoredAnswer:
    """Return the answer of a calibration to the evidence of one world, with the truth; the floor may be 0."""
    ratio = one["gap"][0] / max(one["gap"][1], 1e-9)
    return ScoredAnswer(
        frozenset(one["truth"]), one["kind"], one["family"], predict(one, calibration), ratio, seconds=0.0
    )


def _score_by_family(answers: list[ScoredAnswer]) -> dict[str, Any]:
    """Return the scores of the own skin, of the other sensors, and of each family of worlds."""
    families = sorted({one.family for one in answers})
    groups = {
        "own skin": [name for name in families if name in FAMILIES],
        "other sensors": [name for name in families if name in SENSOR_FAMILIES],
        **{name: [name] for name in families},
    }
    return {
        group: score_answers([one for one in answers if one.family in names])
        for group, names in groups.items()
        if names
    }


def _format(value: float | int | None) -> str:
    """Return a score as the text of a table entry; "-" for None."""
    return "-" if value is None else f"{value:.3f}" if isinstance(value, float) else str(value)


def _print_scores(scores: dict[str, Any]) -> None:
    """Print the scores of all groups of worlds, one block for each group."""
    for group, score in scores.items():
        print(f"{group}:  " + "; ".join(f"{measure} {_format(value)}" for measure, value in score.items()))


def main() -> int:
    """Collect evidence, print the scores on withheld forms and the models, and store the models with --write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--worlds", type=int, default=240, help="number of worlds of the own skin")
    parser.add_argument("--sensor-worlds", type=int, default=120, help="number of worlds of other kinds of sensor")
    parser.add_argument(
        "--several-worlds", type=int, default=300, help="number of further worlds; those with several causes are used"
    )
    parser.add_argument("--seed", type=int, default=4601, help="seed of the worlds")
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--withheld-weight", type=float, default=WITHHELD_WEIGHT, help="weight of withheld effects")
    parser.add_argument("--jobs", type=int, help="number of processes; default: one for each core")
    parser.add_argument("--out", type=Path, help="folder of the evidence")
    parser.add_argument("--datasets", type=Path, help="folder that keeps the datasets of the worlds")
    parser.add_argument("--stored", action="store_true", help="use stored evidence only, of --out or as packaged")
    parser.add_argument("--packaged", action="store_true", help="print the scores of the packaged calibration; no fit")
    parser.add_argument("--write", action="store_true", help="store the fitted models, with the default weight only")
    options = parser.parse_args()
    if options.out is None and not options.stored:
        parser.error("--out: expected a folder for the evidence; or use --stored")
    if options.write and options.withheld_weight != WITHHELD_WEIGHT:
        parser.error("--write: expected the default --withheld-weight; change WITHHELD_WEIGHT instead")
    sample = Sample(options.worlds, options.sensor_worlds, options.several_worlds, options.seed)
    found = (
        read_stored(options.out or PACKAGED)
        if options.stored
        else run(options.out, sample, options.jobs, options.datasets)
    )
    evidence = list_comparisons(found, options.withheld_weight)
    if options.packaged:
        _print_scores(score_packaged(evidence))
        return 0
    _print_scores(score_withheld(evidence, options.folds, options.seed))
    calibration = fit(evidence, describe_source(found))
    print(json.dumps(calibration.to_json(), indent=1))
    if options.write:
        write_whole(TARGET, json.dumps(calibration.to_json(), indent=1) + "\n")
        store_packaged(found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
