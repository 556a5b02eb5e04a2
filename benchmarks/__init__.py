"""Benchmarks: speed (`python -m benchmarks`), identification accuracy and controller design."""

import os

# One thread of linear algebra, as in the ``ground`` command: benchmarks and trials run on all cores
# at once. The packages are loaded before numpy, which reads the variable.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
