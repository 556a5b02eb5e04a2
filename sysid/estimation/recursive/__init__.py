"""The recursive estimate: what a test has told so far, sample by sample while it is flown."""
