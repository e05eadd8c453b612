"""Submaps: prepared, stored one by one or in bulk, read as JSON, GeoJSON and SVG.

Imports `collections`, `index` and below; knows no queries.
"""
