"""Diagnosis of the sim-to-real gap: location, cause, and shrink once the causing effect is added."""
