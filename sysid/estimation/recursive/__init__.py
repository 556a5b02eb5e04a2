"""Recursive estimation: the joint estimate updated at every step of a test, during a dive."""
