"""Proposals: poses worth verifying, by quads, by polygons, by correlation, or by the paper's own matching.

May import the ground floor, `features`, `verify`, `index`, and `paper`.
"""
