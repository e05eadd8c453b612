"""The socket: connections and their timers, file descriptors, start and graceful end.

Imports `runtime`, `http.admission` and below.
"""
