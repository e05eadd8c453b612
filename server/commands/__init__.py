"""The verbs of the command line, one file each; `server/cli.py` puts them together."""
