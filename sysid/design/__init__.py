"""Controller design: PID, LQG and initial gains."""
