"""The decision: verified poses against chance and against every rival pose, and the verdict.

May import every floor below: the ground floor, `features`, `verify`, `index`, `paper`, and `propose`.
"""
