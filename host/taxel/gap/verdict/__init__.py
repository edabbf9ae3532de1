"""Verdict: status, named effects, headline and reasons, derived from the probabilities of the causes."""
