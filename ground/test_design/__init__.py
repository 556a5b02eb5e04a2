"""Output of `ground design-test`: missions, parameters with abort limits, and a table."""
