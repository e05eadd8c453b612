"""Transforms worth verifying: by quads, by polygons, by correlation, or by the paper's chain.

May import the ground floor, `features`, `verify`, `index`, and `paper`.
"""
