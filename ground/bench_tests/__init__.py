"""Tests of the vehicle on the bench: frequency sweep of the tailcone, and inclining test."""
