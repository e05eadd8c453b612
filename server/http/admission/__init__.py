"""Admission control: a fair queue, deadlines, waiting callers, readiness.

Imports `http`, `jobs` and below.
"""
