"""What the operating system provides: processes, threads, file locks, errors of the disk, random ids.

Knows nothing of submaps, SQL or HTTP. Imports `errors` only.
"""
