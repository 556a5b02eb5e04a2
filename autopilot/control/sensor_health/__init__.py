"""Sensor checks: implausible, frozen, silent and inconsistent readings."""
