"""Logs and Prometheus metrics, also of several processes together.

Imports `store` (for gauges over rows) and `config`.
"""
