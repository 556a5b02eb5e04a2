"""Flies the vehicle: a pure tick, and the process that carries it to the wire."""
