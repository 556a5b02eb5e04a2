"""Test design: a set of identification tests for a given time, within safety limits.

``plan.plan`` reads top to bottom: the prior (``prior``), candidate tests (``candidates``), their
largest safe size (``safety_margins``), the information of each (``information``), and the set with
the smallest criterion (``selection``).
"""
