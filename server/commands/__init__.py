"""The commands, one module each. `server/cli.py` puts them together.

Imports `app`, `commands.support` and all rooms of the service.
"""
