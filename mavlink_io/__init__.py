"""Communication between the programs: axes, records, codec, transports and MAVLink services."""
