"""The demo: real forests recognised over HTTP, from an empty directory to a table of how well it went.

Imports `commands` and below.
"""
