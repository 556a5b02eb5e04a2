"""Sweeps on the command line: plan files, engines and reports."""
