"""Several aligned submaps made into one map.

May import the ground floor and `features`.
"""
