"""Validation of an identified model: held-out runs, frequency response, acceptance criteria."""
