"""Parameter estimators: joint (map), linear, recursive, bench tests and profile likelihood."""
