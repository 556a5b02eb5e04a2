"""The recursive estimate of the vehicle under test, from telemetry as it arrives."""
