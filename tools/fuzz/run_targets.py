"""Build the libFuzzer targets of firmware/fuzz, run them one after another, and write their results as JSON.

python tools/fuzz/run_targets.py --seconds 60            a minute for each target (make fuzz SECONDS=60)
python tools/fuzz/run_targets.py --runs 10000000         this number of executions of each target
python tools/fuzz/run_targets.py --keep                  add inputs with new coverage to firmware/fuzz/corpus

Inputs with new coverage are stored in out/fuzz/corpus between runs. Needs clang and its runtime.
"""

import argparse
import json
import re
import shutil
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build" / "fuzz"
OUT = ROOT / "out" / "fuzz"
SEEDS = ROOT / "firmware" / "fuzz" / "corpus"
MISSING = "clang or its runtime is missing: apt-get install clang libclang-rt-14-dev"
LONGEST_INPUT = {"fuzz_codec": 320, "fuzz_sensor": 192, "fuzz_compact": 256, "fuzz_hub": 96, "fuzz_original": 192}
"""Largest size of an input in bytes; longer inputs reach no further code (the hub's script has 48 events)."""

TIMEOUT_S = 20
"""Seconds after which a single input is reported as a hang."""

CORPUS_SIZE = 50
"""Approximate number of inputs of each target in the repository's corpus."""


class FuzzError(Exception):
    """The targets cannot be built or run; the text is one line."""


@dataclass
class Outcome:
    """Result of one target.

    edges: control-flow edges reached. features: edges with their execution counts. inputs: size of the corpus.
    findings: files that reproduce a failure.
    """

    target: str
    executions: int
    seconds: float
    edges: int
    features: int
    inputs: int
    findings: list[str]

    @property
    def executions_per_second(self) -> float:
        """Mean rate of the whole run, including the reading of the corpus."""
        return self.executions / max(self.seconds, 1e-9)


def _run_command(command: list[str]) -> str:
    """Run a command and return its standard output.

    Raises `FuzzError` with the last line of its output if the command fails.
    """
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode:
        lines = (result.stdout + result.stderr).strip().splitlines()
        raise FuzzError(f"{Path(command[0]).name} failed: {lines[-1] if lines else 'no output'}")
    return result.stdout


def find_clang() -> str:
    """Return the path of a clang that can link a libFuzzer target. Raises FuzzError if there is none."""
    clang = shutil.which("clang")
    if not clang:
        raise FuzzError(MISSING)
    BUILD.mkdir(parents=True, exist_ok=True)
    probe = BUILD / "probe.c"
    probe.write_text("int LLVMFuzzerTestOneInput(const unsigned char *b, unsigned long n) { return b && n ? 0 : 0; }\n")
    try:
        _run_command([clang, "-fsanitize=fuzzer,address,undefined", str(probe), "-o", str(BUILD / "probe")])
    except FuzzError:
        raise FuzzError(MISSING) from None
    return clang


def build(clang: str) -> Path:
    """Build the fuzz targets with the compiler `clang` and return their folder. Raises FuzzError."""
    tools = Path(sys.executable).parent
    cmake = str(tools / "cmake") if (tools / "cmake").exists() else "cmake"
    folder = BUILD / "cmake"
    configure = [
        cmake,
        "-S",
        str(ROOT / "firmware"),
        "-B",
        str(folder),
        "-DTAXEL_BUILD_FUZZ=ON",
        f"-DCMAKE_C_COMPILER={clang}",
    ]
    if (tools / "ninja").exists():
        configure += ["-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={tools / 'ninja'}"]
    _run_command(configure)
    _run_command([cmake, "--build", str(folder), "--target", "fuzz_targets"])
    return folder / "fuzz"


def _find_last_number(pattern: str, text: str) -> int:
    """Return the number of the last match of a regular expression in a text; 0 if there is none."""
    numbers = re.findall(pattern, text)
    return int(numbers[-1]) if numbers else 0


def run_target(binary: Path, limits: list[str], seed: int) -> Outcome:
    """Run one target within `limits` (libFuzzer options) and return the result.

    Findings are files in out/fuzz/findings; a failure without such a file is reported as the name of the log.
    """
    corpus, findings = OUT / "corpus" / binary.name, OUT / "findings"
    for folder in (corpus, findings):
        folder.mkdir(parents=True, exist_ok=True)
    before = set(findings.glob(f"{binary.name}-*"))
    options = [
        f"-max_len={LONGEST_INPUT[binary.name]}",
        f"-timeout={TIMEOUT_S}",
        f"-seed={seed}",
        "-print_final_stats=1",
    ]
    options += [f"-artifact_prefix={findings / binary.name}-", "-reload=0", *limits]
    start_s = time.monotonic()
    log = OUT / f"{binary.name}.log"
    with log.open("wb") as output:
        command = [str(binary), *options, str(corpus), str(SEEDS / binary.name)]
        result = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=output, check=False)
    seconds = time.monotonic() - start_s
    text = log.read_text(errors="replace")
    new_findings = sorted(str(path.relative_to(ROOT)) for path in set(findings.glob(f"{binary.name}-*")) - before)
    if result.returncode and not new_findings:
        new_findings = [f"no file; see {log.relative_to(ROOT)}"]
    return Outcome(
        binary.name,
        _find_last_number(r"stat::number_of_executed_units:\s+(\d+)", text) or _find_last_number(r"#(\d+)\s", text),
        round(seconds, 1),
        _find_last_number(r"cov: (\d+)", text),
        _find_last_number(r"ft: (\d+)", text),
        len(list(corpus.iterdir())),
        new_findings,
    )


def _select_cover(binary: Path, name: str, options: list[str], sources: list[Path]) -> list[Path]:
    """Select a minimal set of the inputs in the folders `sources` that has the same coverage, and return its files.

    name: subfolder for the set. options: further libFuzzer options.
    """
    folder = OUT / "merged" / binary.name / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    _run_command([str(binary), "-set_cover_merge=1", *options, str(folder), *map(str, sources)])
    return sorted(folder.iterdir())


def merge_corpus(binary: Path) -> int:
    """Merge the new inputs of a target into the repository's corpus, and return the corpus's number of files.

    The new corpus contains a minimal set of inputs that reach all edges. The longest inputs that also increase the
    execution counts of edges fill it up to `CORPUS_SIZE` files.
    """
    corpus, new_inputs = SEEDS / binary.name, OUT / "merged" / binary.name / "found"
    shutil.rmtree(new_inputs, ignore_errors=True)
    shutil.copytree(OUT / "corpus" / binary.name, new_inputs)
    edges = _select_cover(binary, "edges", ["-use_counters=0"], [corpus, new_inputs])
    counts = sorted(
        _select_cover(binary, "counts", [], [corpus, new_inputs]), key=lambda path: (-path.stat().st_size, path.name)
    )
    selected = {path.name: path for path in (*edges, *counts[: max(CORPUS_SIZE - len(edges), 0)])}
    for path in corpus.iterdir():
        path.unlink()
    for name, path in selected.items():
        shutil.copyfile(path, corpus / name)
    return len(selected)


def main() -> int:
    """Run the fuzz targets of the firmware and print one line for each.

    The exit status is 1 after a finding, and 2 if the targets cannot be built or run.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=int, default=60, help="seconds for each target (default: 60)")
    parser.add_argument("--runs", type=int, help="executions of each target instead of a time")
    parser.add_argument("--target", choices=sorted(LONGEST_INPUT), action="append", help="run only this target")
    parser.add_argument("--seed", type=int, default=1, help="seed of the mutations (default: 1)")
    parser.add_argument("--if-possible", action="store_true", help="without clang, print one line and succeed")
    parser.add_argument("--keep", action="store_true", help="keep new inputs in firmware/fuzz/corpus")
    arguments = parser.parse_args()
    limits = [f"-runs={arguments.runs}"] if arguments.runs else [f"-max_total_time={arguments.seconds}"]
    try:
        folder = build(find_clang())
        outcomes = []
        print(f"seed {arguments.seed}")
        for name in arguments.target or list(LONGEST_INPUT):
            outcome = run_target(folder / name, limits, arguments.seed)
            outcomes.append(outcome)
            print(
                f"{name:12s} {outcome.executions:10d} executions in {outcome.seconds:7.1f} s,"
                f" {outcome.executions_per_second:7.0f}/s, {outcome.edges} edges, {len(outcome.findings)} findings",
                flush=True,
            )
            for path in outcome.findings:
                print(f"  finding; replay: {(folder / name).relative_to(ROOT)} {path}")
            if arguments.keep and not outcome.findings:
                print(f"  firmware/fuzz/corpus/{name}: {merge_corpus(folder / name)} inputs")
    except FuzzError as error:
        print(f"fuzz: {error}", file=sys.stderr)
        return 0 if arguments.if_possible and str(error) == MISSING else 2
    (OUT / "fuzz.json").write_text(json.dumps([asdict(outcome) for outcome in outcomes], indent=1) + "\n")
    return 1 if any(outcome.findings for outcome in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
