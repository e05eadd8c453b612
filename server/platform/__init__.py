"""Processes, threads, file locks and errors of the disk, and ids that sort by time.

Knows nothing of submaps, SQL or HTTP. Imports `errors` only.
"""
