"""Logs, Prometheus metrics, also of several processes together, and the progress of compiling.

Imports `store` (for gauges over rows) and `config`.
"""
