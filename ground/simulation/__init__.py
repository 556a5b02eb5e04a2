"""Simulated dives: start and stop simulator and autopilot processes."""
