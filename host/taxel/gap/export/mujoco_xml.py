"""MJCF with one touch sensor for each taxel, and the Python module for the effects that MJCF cannot express."""

from __future__ import annotations

from typing import Final
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from taxel.gap.export.common import ExportSource
from taxel.gap.export.python_module import list_limits, round_number
from taxel.gap.export.translation import Translation
from taxel.types import FloatArray

VERSION: Final = "4.0.0"
"""Version of MuJoCo with which the attributes were verified (`host/tests/gap/test_gap_export.py`)."""

DEFAULT_TIMESTEP_S: Final = 0.002
"""Default of MuJoCo's option `timestep`, seconds."""

BEFORE_CUTOFF: Final = ("scale", "half_force")
"""Steps that may precede a saturation that is written as a cutoff of the force: both act on each taxel alone."""

NOISE_IS_STORED: Final = (
    "MuJoCo stores the attribute noise, and has not added it since version 3.1.4: the Python module adds the noise"
)


def write_mjcf(source: ExportSource, translation: Translation, timestep_s: float, note: str) -> tuple[str, Translation]:
    """Return the text of an MJCF file, and the translation of the effects that remain for the Python module.

    The sensors measure the normal force, in newtons, at sites with the names taxel_BOARD_TX_RX (address of the board in
    decimal). translation: effects as numeric steps. timestep_s: time step of the model, seconds, from which the number
    of samples of a delay follows. note: line that states the origin of the file.
    """
    delay_s = np.maximum(translation.delay_s, 0.0)
    cutoff_n, remaining = _split_cutoff(source, translation)
    noise_n = _compute_noise_n(source, translation)
    report = source.report
    lines = []
    for taxel, (board, tx, rx) in enumerate(zip(report.sensor, report.tx, report.rx, strict=True)):
        attributes = {"name": f"taxel_{board}_{tx}_{rx}", "site": f"taxel_{board}_{tx}_{rx}"}
        if noise_n[taxel]:
            attributes["noise"] = f"{round_number(float(noise_n[taxel])):g}"
        if cutoff_n[taxel]:
            attributes["cutoff"] = f"{round_number(float(cutoff_n[taxel]))}"
        if delay_s[taxel]:
            # The stored samples must include one before the delayed time; 1e-9 absorbs rounding errors.
            samples = int(np.ceil(delay_s[taxel] / timestep_s - 1e-9)) + 1
            attributes["delay"] = f"{round_number(float(delay_s[taxel]))}"
            attributes |= {"nsample": str(samples), "interp": "linear"}
        lines.append("    <touch " + " ".join(f"{name}={quoteattr(text)}" for name, text in attributes.items()) + "/>")
    comments = [note, f"attributes of MuJoCo {VERSION}; nsample is for the time step {timestep_s:g} s"]
    if noise_n.any():
        comments.append(NOISE_IS_STORED)
    comments += list_limits(translation)
    head = "\n".join(f"  {escape(line).replace('--', '- -')}" for line in comments)
    text = f"<mujoco>\n  <!--\n{head}\n  -->\n  <sensor>\n" + "\n".join(lines) + "\n  </sensor>\n</mujoco>\n"
    return text, remaining.with_fields(delay_s=np.zeros(source.n))


def _compute_noise_n(source: ExportSource, translation: Translation) -> FloatArray:
    """Return the standard deviation of each taxel's noise as a force, newtons, f64[n] (n taxels); 0 without sensor
    model.

    Counts are converted to newtons by the slope of the signal over the force at zero force.
    """
    if source.model is None:
        return np.zeros(source.n)
    slope = source.model.full_scale_drop_counts / (source.model.half_force_n * np.ones(source.n))
    return np.asarray(np.sqrt((translation.noise**2).sum(axis=0)) / slope)


def _split_cutoff(source: ExportSource, translation: Translation) -> tuple[FloatArray, Translation]:
    """Return a saturation as a cutoff of the force, newtons, f64[n] (n taxels), and the translation without the
    saturation.

    The cutoff is 0 for all taxels, and the translation is unchanged, if there is no sharp saturation or no sensor
    model, if an effect outside `BEFORE_CUTOFF` precedes the saturation, or if a taxel has the gain 0.
    """
    limits = np.zeros(source.n)
    clip_index = next((k for k, step in enumerate(translation.steps) if step["kind"] == "clip"), None)
    if clip_index is None or source.model is None:
        return limits, translation
    before = translation.steps[:clip_index]
    if any(step["kind"] not in BEFORE_CUTOFF for step in before):
        return limits, translation
    gain, half_n = np.ones(source.n), source.model.half_force_n * np.ones(source.n)
    for step in before:
        if step["kind"] == "scale":
            gain = gain * step["factor"]
        else:
            half_n = half_n * step["factor"]
    full = source.model.full_scale_drop_counts
    # The force at which the signal, full F / (F + half_n), reaches the limit of the saturation divided by the gain.
    signal = translation.steps[clip_index]["counts"] / np.maximum(gain, 1e-9)
    limits = np.where(signal < full, half_n * signal / np.maximum(full - signal, 1e-9), 0.0)
    if (gain <= 0.0).any():
        return np.zeros(source.n), translation
    return limits, translation.with_fields(steps=before + translation.steps[clip_index + 1 :])
