"""Observer-based controller: an observer that receives the actual command, and state feedback."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from sysid.control_analysis.loop_state_space import ClosedLoop

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class ContinuousController(NamedTuple):
    """Controller x' = A x + B u + L y, u = F x in continuous time.

    The measurement y is relative to the set-point, the command u to its trim (rad). The observer
    receives the limited command, so it does not wind up at a limit.
    """

    A: Array
    B: Array
    L: Array
    """Observer gain, (states, outputs)."""
    F: Array

    @property
    def closed(self) -> Array:
        """System matrix A + B F, if the commanded u is applied without limits."""
        return self.A + np.outer(self.B, self.F)


class SampledController(NamedTuple):
    """Controller x[k] = A x[k-1] + B u[k-1] + L (y[k-1] + y[k]) / 2, u = F x in discrete time."""

    A: Array
    B: Array
    L: Array
    F: Array


def discretise(controller: ContinuousController, dt_s: float) -> SampledController:
    """Return the controller in discrete time.

    The step is exact for a command that is constant over a sample and a measurement that is equal
    to the mean of its two samples: the matrix exponential of [[A, B, L], [0, 0, 0]] dt.
    """
    n, m = controller.A.shape[0], 1 + controller.L.shape[1]
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n], block[:n, n + 1 :] = controller.A, controller.B, controller.L
    step = expm(block * dt_s)
    return SampledController(A=step[:n, :n], B=step[:n, n], L=step[:n, n + 1 :], F=controller.F)


def response(controller: ContinuousController, frequencies_radps: Array) -> ComplexArray:
    """Return the response from y to u, (frequencies, outputs).

    F (s I - A - B F)^-1 L is evaluated as a sum over the modes of `closed`.
    """
    eigenvalues, eigenvectors = np.linalg.eig(controller.closed)
    amplitudes = np.linalg.solve(eigenvectors, controller.L.astype(np.complex128))
    return np.asarray(
        ((controller.F @ eigenvectors) / (1j * frequencies_radps[:, None] - eigenvalues))
        @ amplitudes
    )


def close(controller: ContinuousController, A: Array, B: Array, C: Array) -> ClosedLoop:
    """Return the closed loop with the plant x' = A x + B u, y = C x; plant states come first."""
    closed = np.block([[A, np.outer(B, controller.F)], [controller.L @ C, controller.closed]])
    return ClosedLoop(closed, np.zeros(len(closed)))
