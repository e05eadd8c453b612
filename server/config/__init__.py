"""Settings: their model, where they are read from, and the report of what is in force.

Imports nothing of the service.
"""
