"""``ground design-test``: the tests to fly next, as missions, an abort envelope and a table."""
