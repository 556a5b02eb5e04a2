"""What identification achieves, measured: Monte-Carlo cells over four vehicles, each figure beside
its target."""

import os

# Small matrices on every core at once: threads of the linear algebra would only wait for each
# other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
