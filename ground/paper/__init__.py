"""Reproduction of the source paper: flights, comparisons and page."""
