"""Jobs: long work that is accepted, queued, run by any process, followed and cancelled.

What the jobs do is in `types/`. Imports `constraints`, `submaps` and below.
"""
