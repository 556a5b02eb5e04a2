"""What two processes agree on: axes, records, codec, transports, MAVLink services."""
