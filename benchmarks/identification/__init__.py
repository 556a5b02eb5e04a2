"""Monte-Carlo study of identification with four vehicles; each figure has a target."""

import os

# Trials run on all cores at once: threads of the linear algebra library would only compete.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
