"""Telemetry messages and the vehicle's identity."""
