"""Types of vectors and wrenches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Vector3 = tuple[float, float, float]
Wrench = tuple[float, float, float, float, float, float]
"""Generalised force (X, Y, Z, K, M, N) on the body in FLU axes about the origin, N and N m."""
