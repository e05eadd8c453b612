"""Map merging: several aligned submaps become one map.

May import the ground floor and `features`.
"""
