"""The HIL link, the ground links, and the MAVLink services on them."""
