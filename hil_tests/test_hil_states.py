"""Stateful test of commands, faults and time in random order.

TAXEL_STATE_RUNS and TAXEL_STATE_SEED set the number of runs and the seed (`make fuzz-states`).
"""

import os

from hypothesis import HealthCheck, seed, settings
from hypothesis.stateful import run_state_machine_as_test

from hil_tests.harness.state_machine import SkinMachine

RUNS = int(os.environ.get("TAXEL_STATE_RUNS", "25"))
STEPS = 50
SEED = os.environ.get("TAXEL_STATE_SEED")


def test_invariants_hold_for_commands_faults_and_time_in_random_order() -> None:
    print(f"{RUNS} runs of {STEPS} steps, seed {SEED or 'fixed'}")
    options = settings(
        max_examples=RUNS,
        stateful_step_count=STEPS,
        deadline=None,
        derandomize=SEED is None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    machine = seed(int(SEED))(SkinMachine) if SEED is not None else SkinMachine
    run_state_machine_as_test(machine, settings=options, _min_steps=STEPS)
