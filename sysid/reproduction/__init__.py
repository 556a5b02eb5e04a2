"""Reproduction of the source paper's results."""
