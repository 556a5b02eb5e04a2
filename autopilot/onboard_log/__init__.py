"""The onboard log: a submerged vehicle has no ground link, so it records its own data."""
