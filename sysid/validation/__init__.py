"""Whether an identified model may be trusted: runs it was not fitted to, its response, and a
verdict with gates."""
