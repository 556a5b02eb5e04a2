"""The Kalman filter's arithmetic: gains of a time-varying filter, and residuals turned into its
innovations."""

import math

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.jit import kernel

Array = NDArray[np.float64]

GAIN_TOLERANCE = 1e-7
"""Change of a filter's gain from sample to sample, relative to the largest, at which it is taken to
stand."""


@kernel
def riccati(
    A: Array, Q: Array, C: Array, R: Array, P0: Array, samples: int
) -> tuple[Array, Array, Array]:
    """Gains, whiteners and log determinants of the filter, which repeats its last gain once it has
    settled."""
    n, outputs = A.shape[0], C.shape[0]
    gains = np.empty((samples, n, outputs))
    whiteners = np.zeros((samples, outputs, outputs))
    log_dets = np.empty(samples)
    P, PC, AP = P0.copy(), np.empty((n, outputs)), np.empty((n, n))
    G = np.empty((n, outputs))
    settled = False
    for k in range(samples):
        if settled:
            gains[k], whiteners[k], log_dets[k] = gains[k - 1], whiteners[k - 1], log_dets[k - 1]
            continue
        _product(P, C, PC)
        W = whiteners[k]
        log_dets[k] = _inverse_root(PC, C, R, W)
        # G = P C' W' gives K = G W and the update P - G G'.
        _product(PC, W, G)
        for i in range(n):
            for j in range(outputs):
                gains[k, i, j] = 0.0
                for m in range(j, outputs):
                    gains[k, i, j] += G[i, m] * W[m, j]
        for i in range(n):
            for j in range(n):
                for m in range(outputs):
                    P[i, j] -= G[i, m] * G[j, m]
        _product(A, P, AP)
        _product(AP, A, P)
        change = largest = 0.0
        for i in range(n):
            for j in range(n):
                P[i, j] += Q[i, j]
            for j in range(outputs):
                largest = max(largest, abs(gains[k, i, j]))
                change = max(change, abs(gains[k, i, j] - gains[k - 1, i, j]) if k > 0 else np.inf)
        settled = change < GAIN_TOLERANCE * largest
    return gains, whiteners, log_dets


@kernel
def _product(left: Array, right: Array, out: Array) -> None:
    """out = left right', no allocation: these matrices are far too small for a library call."""
    for i in range(left.shape[0]):
        for j in range(right.shape[0]):
            total = 0.0
            for k in range(left.shape[1]):
                total += left[i, k] * right[j, k]
            out[i, j] = total


@kernel
def _inverse_root(PC: Array, C: Array, R: Array, W: Array) -> float:
    """W = L^-1 with L L' = C P C' + R, of up to a few rows; returns the log determinant of L L'."""
    outputs = C.shape[0]
    L = np.empty((outputs, outputs))
    log_det = 0.0
    for i in range(outputs):
        for j in range(i + 1):
            total = R[i, j]
            for k in range(C.shape[1]):
                total += C[i, k] * PC[k, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = math.sqrt(total) if i == j else total / L[j, j]
        log_det += 2.0 * math.log(L[i, i])
        for j in range(i):
            total = 0.0
            for k in range(j, i):
                total -= L[i, k] * W[k, j]
            W[i, j] = total / L[i, i]
        W[i, i] = 1.0 / L[i, i]
    return log_det


@kernel
def whiten(
    residual: Array, transition: Array, output: Array, gains: Array, whiteners: Array
) -> Array:
    """Normalised innovations, (samples, outputs): white and of unit variance if the noise model
    holds."""
    samples, outputs = residual.shape
    n = transition.shape[0]
    white = np.empty((samples, outputs))
    x, updated, e = np.zeros(n), np.empty(n), np.empty(outputs)
    for k in range(samples):
        for i in range(outputs):
            e[i] = residual[k, i]
            for j in range(n):
                e[i] -= output[i, j] * x[j]
        for i in range(outputs):
            white[k, i] = 0.0
            for j in range(i + 1):
                white[k, i] += whiteners[k, i, j] * e[j]
        for i in range(n):
            updated[i] = x[i]
            for j in range(outputs):
                updated[i] += gains[k, i, j] * e[j]
        for i in range(n):
            x[i] = 0.0
            for j in range(n):
                x[i] += transition[i, j] * updated[j]
    return white


@kernel
def whiten_block(
    block: Array, transition: Array, output: Array, gains: Array, whiteners: Array
) -> Array:
    """``whiten`` of many residuals at once: the last axis of (samples, outputs, columns)."""
    samples, outputs, columns = block.shape
    n = transition.shape[0]
    white = np.zeros((samples, outputs, columns))
    x, updated, e = np.zeros((n, columns)), np.empty((n, columns)), np.empty((outputs, columns))
    for k in range(samples):
        for i in range(outputs):
            for c in range(columns):
                e[i, c] = block[k, i, c]
            for j in range(n):
                if output[i, j] != 0.0:
                    for c in range(columns):
                        e[i, c] -= output[i, j] * x[j, c]
            for j in range(i + 1):
                for c in range(columns):
                    white[k, i, c] += whiteners[k, i, j] * e[j, c]
        for i in range(n):
            for c in range(columns):
                updated[i, c] = x[i, c]
            for j in range(outputs):
                for c in range(columns):
                    updated[i, c] += gains[k, i, j] * e[j, c]
        for i in range(n):
            for c in range(columns):
                x[i, c] = 0.0
            for j in range(n):
                if transition[i, j] != 0.0:
                    for c in range(columns):
                        x[i, c] += transition[i, j] * updated[j, c]
    return white
