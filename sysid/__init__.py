"""From logs to gains: read, cut, screen, fit, redesign, verify."""
