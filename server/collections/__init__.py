"""Collections and their map frames: made, changed, listed, placed on Earth.

Imports `index`, `resources`, `security`, `schemas`, `store` and below.
"""
