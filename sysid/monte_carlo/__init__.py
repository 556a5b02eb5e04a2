"""Monte-Carlo simulation of a mission with vehicles sampled from a model's posterior.

``study.simulate_samples`` reads top to bottom: the sampled vehicles (``samples``), their motion
(``dynamics``), disturbances (``disturbance``) and sensor noise (``instruments``), a mission through
the autopilot's own tick (``simulate``), and the results (``metrics``, ``study``).

All inputs come from the identified model and its vehicle file. The simulator's environment is not
used.
"""
