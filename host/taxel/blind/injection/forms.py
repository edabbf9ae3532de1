"""Functional forms of injected causes. A form samples its parameters for a world and returns the injection."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.blind.hidden import UNKNOWN
from taxel.blind.injection import coupling_forms, outside_forms, reserved_forms, taxel_forms, time_forms
from taxel.blind.injection.skin_counts import Injection, SkinTable

Sampler = Callable[[SkinTable, np.random.Generator], Injection]
"""Function that samples the parameters of a form for one skin and returns the injection."""


@dataclass(frozen=True)
class InjectedForm:
    """A functional form of a cause.

    name: effect of the catalogue, or "unknown" for a cause outside the catalogue. form: name of the form. sample:
    samples its parameters. needs_separation: whether it needs the simulated separation between skin and object.
    """

    name: str
    form: str
    sample: Sampler
    needs_separation: bool = False


INJECTED_FORMS: Final = (
    InjectedForm("contact_propagation", "gaussian", coupling_forms.sample_gaussian_spread),
    InjectedForm("contact_propagation", "lorentzian", coupling_forms.sample_lorentzian_spread),
    InjectedForm("electrode_crosstalk", "ladder", coupling_forms.sample_ladder),
    InjectedForm("electrode_crosstalk", "root sum of squares", coupling_forms.sample_root_sum),
    InjectedForm("noise", "heavy tails", time_forms.sample_heavy_noise),
    InjectedForm("noise", "bursts", time_forms.sample_bursts),
    InjectedForm("gain_mismatch", "gradient", taxel_forms.sample_gradient),
    InjectedForm("gain_mismatch", "uniform", taxel_forms.sample_uniform_gain),
    InjectedForm("stiffness", "power law", taxel_forms.sample_power_law),
    InjectedForm("baseline_drift", "ramp", time_forms.sample_ramp),
    InjectedForm("baseline_drift", "random walk", time_forms.sample_walk),
    InjectedForm("hysteresis", "backlash", time_forms.sample_backlash),
    InjectedForm("hysteresis", "three times", time_forms.sample_creep),
    InjectedForm("saturation", "hyperbolic tangent", taxel_forms.sample_tanh),
    InjectedForm("saturation", "logarithm", taxel_forms.sample_logarithm),
    InjectedForm("proximity", "gaussian", taxel_forms.sample_near_field, needs_separation=True),
    InjectedForm("dropout", "cracked line", taxel_forms.sample_cracked_line),
    InjectedForm("dropout", "dead strip", taxel_forms.sample_dead_strip),
    InjectedForm("latency", "jitter", time_forms.sample_jitter),
    InjectedForm("latency", "two poles", time_forms.sample_two_poles),
    InjectedForm(UNKNOWN, "dead zone", outside_forms.sample_dead_zone),
    InjectedForm(UNKNOWN, "common mode removed", outside_forms.sample_common_mode),
    InjectedForm(UNKNOWN, "interference", outside_forms.sample_interference),
    InjectedForm(UNKNOWN, "automatic gain", outside_forms.sample_automatic_gain),
    InjectedForm(UNKNOWN, "mirrored board", outside_forms.sample_mirrored_board),
    InjectedForm(UNKNOWN, "sharpening", outside_forms.sample_sharpening),
)
"""Forms of the calibration. The emulator contains none of them, and the catalogue of the diagnosis none exactly; forms
with a shape parameter approximate several of them."""

RESERVED_FORMS: Final = (
    InjectedForm("contact_propagation", "disc", reserved_forms.sample_disc),
    InjectedForm("contact_propagation", "two scales", reserved_forms.sample_two_scales),
    InjectedForm("electrode_crosstalk", "adjacent lines", reserved_forms.sample_adjacent_lines),
    InjectedForm("electrode_crosstalk", "limited", reserved_forms.sample_limited_crosstalk),
    InjectedForm("noise", "slow", reserved_forms.sample_slow_noise),
    InjectedForm("gain_mismatch", "lines", reserved_forms.sample_line_gains),
    InjectedForm("stiffness", "stiffening", reserved_forms.sample_stiffening),
    InjectedForm("baseline_drift", "warm-up", reserved_forms.sample_warm_up),
    InjectedForm("hysteresis", "power creep", reserved_forms.sample_power_creep),
    InjectedForm("hysteresis", "slow unloading", reserved_forms.sample_slow_unloading),
    InjectedForm("saturation", "arctangent", reserved_forms.sample_arctangent),
    InjectedForm("saturation", "two slopes", reserved_forms.sample_two_slopes),
    InjectedForm("proximity", "inverse square", reserved_forms.sample_inverse_square, needs_separation=True),
    InjectedForm("dropout", "single taxels", reserved_forms.sample_single_taxels),
    InjectedForm("latency", "slow clock", reserved_forms.sample_slow_clock),
    InjectedForm(UNKNOWN, "ghost", reserved_forms.sample_ghost),
    InjectedForm(UNKNOWN, "rebound", reserved_forms.sample_rebound),
    InjectedForm(UNKNOWN, "wobble", reserved_forms.sample_wobble),
)
"""Forms that are reserved for tests: no calibration and no development of the diagnosis has used them."""
