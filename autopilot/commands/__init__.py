"""Handlers of MAV_CMD commands (COMMAND_LONG and COMMAND_INT), with a table in each module."""
