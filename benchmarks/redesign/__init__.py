"""What redesigned gains achieve in the water, flown: Monte-Carlo cells, each figure beside its
target."""

import os

# Small matrices on every core at once: threads of the linear algebra would only wait for each
# other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
