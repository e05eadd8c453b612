"""The demo: places in real forests recognised over HTTP, from an empty folder to a table of results.

Imports `commands` and below.
"""
