"""Monte-Carlo study of redesigned gains in simulated dives; each figure has a target."""
