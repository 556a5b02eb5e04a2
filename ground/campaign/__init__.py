"""The campaign: prototype flight, tests, refit, redesign and verification."""
