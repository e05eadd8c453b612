"""What several commands share: options, tables, failures, signals, the supervisor of processes.

Imports `app` and the rooms below it.
"""
