"""Indentation campaigns: a rig presses objects into a skin, on the emulated hand and in the simulator."""

from taxel.campaign.indentation.emulated import run_emulated_indentations
from taxel.campaign.indentation.plan import IndentationApproach, IndentationPlan, IndenterMount, PlannedIndentation
from taxel.campaign.indentation.sampling import IndentationDesign, sample_indentation_plan
from taxel.campaign.indentation.settings import (
    RIG_VARIATION,
    SimIndentationSettings,
    indentation_settings,
    indentation_timeline,
)
from taxel.campaign.indentation.simulated import run_simulated_indentations

__all__ = [
    "RIG_VARIATION",
    "IndentationApproach",
    "IndentationDesign",
    "IndentationPlan",
    "IndenterMount",
    "PlannedIndentation",
    "SimIndentationSettings",
    "indentation_settings",
    "indentation_timeline",
    "run_emulated_indentations",
    "run_simulated_indentations",
    "sample_indentation_plan",
]
