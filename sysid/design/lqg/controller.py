"""A control law with a model inside: an observer that knows what was commanded, and feedback of
what it believes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from sysid.control_analysis.loop_transfer import ClosedLoop

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class DiscreteController(NamedTuple):
    """x' = A x + B u + L y, u = F x: y is what is measured, about its set-point, u the command
    about its trim (rad).

    u is what the tailcone was told, limits and all: an observer that knows of them does not wind
    up."""

    A: Array
    B: Array
    L: Array
    """(states, outputs)."""
    F: Array

    @property
    def closed(self) -> Array:
        """A where the tailcone is told what the law wants."""
        return self.A + np.outer(self.B, self.F)


class SampledController(NamedTuple):
    """x[k] = A x[k-1] + B u[k-1] + L (y[k-1] + y[k])/2, u = F x."""

    A: Array
    B: Array
    L: Array
    F: Array


def discretise(law: DiscreteController, dt_s: float) -> SampledController:
    """Exact for a command that stands still between samples, and for a measurement that stands at
    its mean."""
    n, m = law.A.shape[0], 1 + law.L.shape[1]
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n], block[:n, n + 1 :] = law.A, law.B, law.L
    step = expm(block * dt_s)
    return SampledController(step[:n, :n], step[:n, n], step[:n, n + 1 :], law.F)


def response(law: DiscreteController, frequencies_radps: Array) -> ComplexArray:
    """From y to u, (frequencies, outputs): a sum over the modes of ``law.closed``."""
    values, right = np.linalg.eig(law.closed)
    amounts = np.linalg.solve(right, law.L.astype(np.complex128))
    return np.asarray(((law.F @ right) / (1j * frequencies_radps[:, None] - values)) @ amounts)


def close(law: DiscreteController, A: Array, B: Array, C: Array) -> ClosedLoop:
    """Round x' = A x + B u, y = C x; the plant's states come first."""
    closed = np.block([[A, np.outer(B, law.F)], [law.L @ C, law.closed]])
    return ClosedLoop(closed, np.zeros(len(closed)))
