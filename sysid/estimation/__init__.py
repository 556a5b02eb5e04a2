"""Parameter estimators."""
