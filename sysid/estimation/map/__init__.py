"""Joint maximum a posteriori estimate of both planes.

Modules: data of the fit (``datasets``), cost function (``problem``), sensitivities, search
(``gauss_newton``), estimate (``fit``), ``intervals`` and failure criteria (``convergence``).
"""
