"""Linear estimators of one plane: small-signal equations of motion and tailcone.

Modules: estimated values (``linear_model``), exact response and sensitivities (``response``,
``tailcone``), data and prior (``records``), cost functions (``output_error`` for sensor noise only,
``filter_error`` for disturbance and sensor noise), search from many starts and uniqueness
(``multistart``), ``estimate``, Cramer-Rao bound (``cramer_rao``), and the model file (``report``).
"""
