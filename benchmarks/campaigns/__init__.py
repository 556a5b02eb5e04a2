"""Campaigns of unlike vehicles: whether they complete, and whether the redesign is better."""
