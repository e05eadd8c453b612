"""The index of a collection: quads and polygons that are near those of a query, and the segment files that hold them.

May import the ground floor and `features`.
"""
