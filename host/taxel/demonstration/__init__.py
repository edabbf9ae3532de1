"""The scripted contacts that `taxel feel` applies to the emulated skin."""

from taxel.demonstration.scripted_contacts import (
    DEMO_CONTACTS,
    ContactOutcome,
    DemonstrationResult,
    run_demonstration,
)

__all__ = ["DEMO_CONTACTS", "ContactOutcome", "DemonstrationResult", "run_demonstration"]
