"""Caribou's physics: six degrees of freedom, knowing neither sockets nor autopilots.

``config.load`` reads a vehicle file, ``calibrate.build`` makes its ``Model``, ``dynamics`` steps
it, ``linearise`` reads the linear planes off it and ``derive`` shows where the first-principles
numbers come from."""
