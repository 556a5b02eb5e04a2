"""Live page for browsers on this machine: what it shows, its server, and the feed from a flight."""
