"""`make bench-reliability`: does the service keep what it says, whatever is sent to it and whatever happens to it?

Each part runs against a real server in a process of its own (the readers in this one), and leaves what it did, what it
counted and how long that took in docs/results/reliability_<part>.json. docs/reliability.md is written from those alone.
"""
