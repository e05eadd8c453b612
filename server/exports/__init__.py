"""A collection as tables for GIS: landmarks, submaps, matches of stored queries, and the pairs of trees in these."""
