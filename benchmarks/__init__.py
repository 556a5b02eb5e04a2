"""Benchmarks of identification accuracy, controller design and speed."""
