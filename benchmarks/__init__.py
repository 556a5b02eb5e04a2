"""Benchmarks: speed (`python -m benchmarks`), identification accuracy and controller design."""
