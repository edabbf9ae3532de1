"""Digital twin of a skin: a live stream, compared with its reference."""

from taxel.twin.comparison import HOURS_PER_FALSE_ALARM, StepResult, Twin
from taxel.twin.errors import TwinInputError
from taxel.twin.events import Alarm, CauseEvent, Cleared, Event, InputFault
from taxel.twin.reference import Reference, read_reference
from taxel.twin.reference_models import fit_reference_models
from taxel.twin.schedule import Contact, ContactSchedule, read_schedule
from taxel.twin.variance_factors import VarianceFactors

__all__ = [
    "HOURS_PER_FALSE_ALARM",
    "Alarm",
    "CauseEvent",
    "Cleared",
    "Contact",
    "ContactSchedule",
    "Event",
    "InputFault",
    "Reference",
    "StepResult",
    "Twin",
    "TwinInputError",
    "VarianceFactors",
    "fit_reference_models",
    "read_reference",
    "read_schedule",
]
