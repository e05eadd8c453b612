"""Which requests are worked on now: a fair queue, deadlines, waiting callers, readiness.

Imports `http`, `jobs` and below.
"""
