"""A hardware test: a plan, phases that measure and find faults, and a record of it as file, page and history."""
