"""Inspect, export, repair and convert logs."""
