"""One consistent map from submaps and the constraints between them, and their poses moved to it.

Imports `constraints`, `submaps` and below.
"""
