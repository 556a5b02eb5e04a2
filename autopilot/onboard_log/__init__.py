"""The vehicle records herself: a submerged vehicle has no link, and nobody else to keep what she
felt and did."""
