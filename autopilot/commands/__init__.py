"""MAV_CMD: what each command of COMMAND_LONG and COMMAND_INT asks of the vehicle, by a table in
each file."""
