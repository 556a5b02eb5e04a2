"""The LOG_* service, by which every ground station lists and fetches a vehicle's logs: both ends of
it."""
