"""Duration of the diagnosis of a whole campaign, compared with one minute. The campaign is stored in out/bench."""

import json
import sys
import time
from pathlib import Path

from figures import Figure

from taxel.campaign.emulated import run_emulated
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.gap.diagnosis import diagnose
from taxel.grasp.plan import make_thesis_plan

ALLOWED_S, GRASPS = 60.0, 144
SEED = 1
FOLDER = Path("out/bench")


def make_campaign(folder: Path = FOLDER) -> None:
    """Create the emulated ("real") and the simulated dataset of 144 grasps, with the default effects.

    This takes some minutes. An interrupted run is resumed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    plan = make_thesis_plan(SEED)[:GRASPS]
    run_emulated(folder / "real.h5", plan, EmulatedSettings(), resume=(folder / "real.h5").exists())
    run_simulated(folder / "sim.h5", plan, SimSettings(), resume=(folder / "sim.h5").exists())
    (folder / "complete.json").write_text(json.dumps({"grasps": len(plan)}))


def measure() -> list[Figure]:
    """Run the benchmark of the diagnosis: allowed seconds divided by elapsed seconds.

    No ratio if the campaign does not exist.
    """
    name, reference = f"diagnosis of {GRASPS} grasps", f"{ALLOWED_S:g} s"
    if not (FOLDER / "complete.json").exists():
        detail = "not measured: create the campaign with python tools/bench/bench_diagnosis.py"
        return [Figure(name, None, None, reference, detail)]
    start = time.perf_counter()
    diagnose(FOLDER / "real.h5", FOLDER / "sim.h5")
    elapsed_s = time.perf_counter() - start
    return [Figure(name, ALLOWED_S / elapsed_s, 1.0, reference, f"{elapsed_s:.1f} s, default effects")]


if __name__ == "__main__":
    make_campaign()
    print(*measure(), file=sys.stdout)
