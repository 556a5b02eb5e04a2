"""Estimators on public free-running tests and logs."""
