"""Logs as ground and the vehicle write them alike: MCAP files of MAVLink messages."""
