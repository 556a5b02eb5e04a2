"""Simulated faults: scheduled in scenarios or commanded by ground stations.

``catalogue`` defines the faults and their parameters, ``timeline`` their start and end. ``body``,
``tailcone`` and ``readings`` apply them to the vehicle, its actuators and its sensors.
``failure_injection`` implements MAV_CMD_INJECT_FAILURE.
"""
