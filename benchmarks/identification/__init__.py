"""What identification achieves, measured: Monte-Carlo cells over four vehicles, each figure beside its target."""
