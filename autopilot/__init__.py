"""The autopilot: a pure control tick, and the process that connects it to MAVLink links."""
