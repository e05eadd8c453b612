"""Constraints between the submaps of a collection, for pose graphs: found, and written as JSON or g2o.

Imports `queries` and below.
"""
