"""Study: observer-based (LQG) control compared with PID loops of the same specification."""
