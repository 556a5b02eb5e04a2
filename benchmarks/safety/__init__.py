"""Safety of the closed loop: faults, pairs of faults, parameters and random missions."""
