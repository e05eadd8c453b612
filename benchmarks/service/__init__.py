"""What the service costs: `python -m benchmarks.service` measures it beside an older commit, in one run.

connection       a client of HTTP that costs next to nothing, for one request at a time and for crowds
versions         the code of this checkout or of a commit: its service and its library, in processes of their own
workload         what is stored and asked
single           one query at a time: the library and HTTP in turn
crowd            many clients at once
start_costs      start, memory, installed size
marks, waterfall one query from the first byte sent to the last one received
history          figures of each release, relative to a calibration loop
report           the section of docs/scaling.md
"""
