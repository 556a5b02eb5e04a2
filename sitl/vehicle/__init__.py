"""Vehicle physics in six degrees of freedom; no sockets and no autopilot.

``config.load`` reads a vehicle file, ``build_model.build`` makes its ``VehicleModel``, ``dynamics``
integrates it, ``linearise`` computes the linear yaw and pitch planes and ``first_principles`` shows
how Table 1's initial column follows from geometry.
"""
