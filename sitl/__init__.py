"""Simulator of the vehicle, its tailcone, its sensors and the surrounding water."""
