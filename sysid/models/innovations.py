"""Time-varying Kalman filter: its gains, and the whitening of residuals to innovations.

Symbols: n states, m outputs, k sample; A (n, n) transition, C (m, n) output, Q process and R
measurement covariance, P state covariance before the measurement, e residual. During a manoeuvre A
and Q change: both have one entry for every ``hold`` samples, the last of which holds until the end;
a constant filter has one entry. Per sample:

    S = C P C^T + R = L L^T,   W = L^-1 (whitener),   log det S,
    G = P C^T W^T,   K = G W (gain),
    P <- A (P - G G^T) A^T + Q,
    e_k = y_k - C x,   innovation = W e_k,   x <- A (x + K e_k).

The normalised innovations W e are white with unit variance if the noise model is correct (filter
error method; Jategaonkar 2015, ch. 5).
"""

import math

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import kernel

Array = NDArray[np.float64]

GAIN_TOLERANCE = 1e-7
"""Relative change of the gain per sample below which the filter is treated as stationary."""


@kernel
def riccati(
    transitions: Array, processes: Array, hold: int, C: Array, R: Array, P0: Array, samples: int
) -> tuple[Array, Array, Array]:
    """Return gains (samples, n, m), whiteners (samples, m, m) and log det S (samples,).

    Once the gain of a constant filter changes by less than GAIN_TOLERANCE, the last values are
    repeated.
    """
    # Equations: module docstring; ``transitions`` and ``processes``, (entries, n, n), are A and Q.
    entries, n, outputs = transitions.shape[0], transitions.shape[1], C.shape[0]
    gains = np.empty((samples, n, outputs))
    whiteners = np.zeros((samples, outputs, outputs))
    log_dets = np.empty(samples)
    P, PC, AP = P0.copy(), np.empty((n, outputs)), np.empty((n, n))
    G = np.empty((n, outputs))
    for k in range(samples):
        entry = min(k // hold, entries - 1)
        A, Q = transitions[entry], processes[entry]
        _product(P, C, PC)
        W = whiteners[k]
        log_dets[k] = _inverse_root(PC, C, R, W)
        # G = P C^T W^T gives the gain K = G W and the update P - G G^T.
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
        if entries == 1 and change < GAIN_TOLERANCE * largest:
            gains[k + 1 :], whiteners[k + 1 :], log_dets[k + 1 :] = (
                gains[k],
                whiteners[k],
                log_dets[k],
            )
            break
    return gains, whiteners, log_dets


@kernel
def _product(left: Array, right: Array, out: Array) -> None:
    """Write left right^T into ``out``; a loop is faster than a library call at this size."""
    for i in range(left.shape[0]):
        for j in range(right.shape[0]):
            total = 0.0
            for k in range(left.shape[1]):
                total += left[i, k] * right[j, k]
            out[i, j] = total


@kernel
def _inverse_root(PC: Array, C: Array, R: Array, W: Array) -> float:
    """Write W = L^-1 with L L^T = C P C^T + R; return the log determinant of L L^T."""
    # Cholesky factorisation row by row; W by forward substitution.
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
    residual: Array,
    transitions: Array,
    hold: int,
    output: Array,
    gains: Array,
    whiteners: Array,
) -> Array:
    """Return the normalised innovations W e of a residual, (samples, outputs)."""
    # Equations: module docstring; ``updated`` is x + K e.
    samples, outputs = residual.shape
    entries, n = transitions.shape[0], transitions.shape[1]
    white = np.empty((samples, outputs))
    x, updated, e = np.zeros(n), np.empty(n), np.empty(outputs)
    for k in range(samples):
        transition = transitions[min(k // hold, entries - 1)]
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
    block: Array,
    transitions: Array,
    hold: int,
    output: Array,
    gains: Array,
    whiteners: Array,
) -> Array:
    """Return ``whiten`` of many residuals at once: the last axis of (samples, outputs, columns)."""
    # Equations: module docstring, for each column; zeros of C and A are skipped.
    samples, outputs, columns = block.shape
    entries, n = transitions.shape[0], transitions.shape[1]
    white = np.zeros((samples, outputs, columns))
    x, updated, e = np.zeros((n, columns)), np.empty((n, columns)), np.empty((outputs, columns))
    for k in range(samples):
        transition = transitions[min(k // hold, entries - 1)]
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
