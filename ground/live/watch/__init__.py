"""``ground watch``: a live view of any MAVLink vehicle in a terminal."""
