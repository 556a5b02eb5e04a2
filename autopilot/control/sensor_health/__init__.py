"""Sensor checks: implausible, frozen, silent or inconsistent samples."""
