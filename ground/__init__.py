"""Ground software: fly missions, record telemetry, identify models, redesign gains and report."""
