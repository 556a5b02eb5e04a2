"""The simulated sea: Caribou, her tailcone, the water round her and the instruments she carries."""
