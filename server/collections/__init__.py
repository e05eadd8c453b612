"""Collections and their map frames: created, changed, listed, placed on Earth.

Imports `index`, `resources`, `security`, `schemas`, `store` and below.
"""
