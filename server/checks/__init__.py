"""What `urquhart db check` proves: file, schema, rows, features and index agree.

Reads only. Imports `index`, `submaps` and below.
"""
