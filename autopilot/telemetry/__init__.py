"""Telemetry messages and the identity of the vehicle."""
