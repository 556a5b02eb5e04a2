"""Logs as arrays: readers, test segments and consistency checks of the data."""
