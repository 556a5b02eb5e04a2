"""System identification and control design.

Logs, segments, screening, fit, design, verification.
"""
