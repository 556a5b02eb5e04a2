"""``ground rehearse``: a mission flown beforehand by the vehicles that a model allows for."""
