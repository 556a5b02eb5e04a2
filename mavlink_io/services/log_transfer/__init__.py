"""Client and server of MAVLink's LOG_* messages, with which ground stations download logs."""
