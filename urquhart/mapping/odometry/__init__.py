"""Which trusted constraints, such as odometry, may be believed.

Imports `mapping` and below.
"""
