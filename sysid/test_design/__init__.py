"""Which tests to fly: a set that tells most about a vehicle in the water time there is, and stays
within limits.

``plan.plan`` reads top to bottom: what is believed (``belief``), what could be flown (``library``),
how large it may be (``excursions``), what each would tell (``information``), and which of them
together tell most (``choice``)."""
