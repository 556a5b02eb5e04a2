"""Sweeps: thousands of simulated dives over vehicles, gains, missions, seas, faults and seeds."""
