"""Commands on what a database holds, also while a service runs on it: API keys, jobs, stands.

Imports `commands.support` and below.
"""
