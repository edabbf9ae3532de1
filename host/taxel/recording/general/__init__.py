"""Grasp datasets of version 2: any tactile sensor, few required fields."""

from taxel.recording.general.dataset import GeneralDataset
from taxel.recording.general.format import Contact, Properties, TaxelPlaces
from taxel.recording.general.writer import write_general

__all__ = ["Contact", "GeneralDataset", "Properties", "TaxelPlaces", "write_general"]
