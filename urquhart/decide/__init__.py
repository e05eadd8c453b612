"""The verdict: verified poses against chance and against every rival pose.

May import every floor below: the ground floor, `features`, `verify`, `index`, `paper`, and `propose`.
"""
