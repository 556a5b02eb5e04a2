"""Vehicles from outside: simulated plants that share no code with ``sitl`` and ``sysid``.

Four plants differ from the model that identification fits in structure, not only in numbers:

========  ==================  ==============================  ==============================
plant     prior               hull and tail                   actuator
========  ==================  ==============================  ==============================
race      caribou_nominal     crossflow heavier aft; rudder   overdamped lag, play, steps of
                              in the propeller race; thrust   0.1 deg
                              deduction and wake in turns
stall     xfin_auv            crossflow at three points;      first-order lag with stiction,
                              four fins that stall; linear    lift that follows late
                              thrust
lumped    remus100            quadratic coefficients; cubic   velocity servo with dead band
                              loss of rudder force            and steps of 0.25 deg
vortex    my_vehicle          vortex lift off the hull;       different lags of rudder and
                              constant power                  elevator, play
========  ==================  ==============================  ==============================

Axes are FRD and NED (MAVLink's), SI units. ``forces`` has the equations of motion, ``actuators``
the surfaces, ``flight`` the loops, the sea and the sensors, ``small_signal`` the true linear
response, ``logs`` the files.
"""
