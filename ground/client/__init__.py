"""Client of one MAVLink vehicle: parameters, missions, logs, commands and recording."""
