"""Logs as arrays: readers, test segments and data checks."""
