"""Links: the HIL link, the links to the ground, and the services on them."""
