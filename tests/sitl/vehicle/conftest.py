"""Hypothesis times each example by the wall clock; a kernel compiled on first call is no defect."""

from hypothesis import settings

settings.register_profile("no deadline", deadline=None)
settings.load_profile("no deadline")
