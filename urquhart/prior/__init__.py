"""A search where the caller knows roughly the pose: every pose of a window, scored without pairing, and its decision.

May import the ground floor, `features`, `verify`, `index`, `propose`, and `decide`.
"""
