"""How two map frames lie to each other.

Imports `mapping` and below.
"""
