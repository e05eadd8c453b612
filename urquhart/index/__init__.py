"""Which quads and polygons of a collection are near those of a query, and the segment files that hold them.

May import the ground floor and `features`.
"""
