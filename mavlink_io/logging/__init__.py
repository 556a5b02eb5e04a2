"""Log files: MCAP files of MAVLink messages, written by all programs, and MAVLink tlog files."""
