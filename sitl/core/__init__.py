"""The pure simulation step: actuators, body, sensors and environment."""
