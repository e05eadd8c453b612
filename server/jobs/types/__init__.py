"""What each type of job does: import, reindex, find constraints; `job_types` is the table of them.

Imports `jobs` and below.
"""
