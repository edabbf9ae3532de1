"""Objects pressed into a skin on a rig: small campaigns, quickly made."""

from taxel.campaign.press.drawing import random_press_plan
from taxel.campaign.press.plan import PlannedPress, PressApproach, PressMount, PressPlan
from taxel.campaign.press.pressed import run_pressed
from taxel.campaign.press.settings import PRESS_SCATTER, SimPressSettings, press_settings, press_timeline
from taxel.campaign.press.simulated import simulate_pressed

__all__ = [
    "PRESS_SCATTER",
    "PlannedPress",
    "PressApproach",
    "PressMount",
    "PressPlan",
    "SimPressSettings",
    "press_settings",
    "press_timeline",
    "random_press_plan",
    "run_pressed",
    "simulate_pressed",
]
