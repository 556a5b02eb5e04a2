"""A mission flown beforehand by the vehicles that a model allows for, under the gains that are to
go to sea.

``study.rehearse`` reads top to bottom: who may come (``crew``), how she moves (``tail``, ``body``),
what pushes her (``disturbance``) and what her instruments tell (``instruments``), a mission through
the autopilot's own tick (``dive``), and what is said of it (``outcome``, ``study``).

Everything comes from the model and the file it is a change of. Nothing here has seen the
simulator's sea."""
