"""Tables with a place in each row, written as CSV, GeoJSON, GeoPackage and GeoParquet.

Rows come in batches and are written as they come, so that memory does not grow with their number.
"""
