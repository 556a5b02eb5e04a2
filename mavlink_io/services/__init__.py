"""MAVLink services: parameters, missions, file transfer and log transfer."""
