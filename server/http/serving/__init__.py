"""The socket: connections and their timers, file descriptors, start and graceful end.

Imports `service_parts`, `http.admission` and below.
"""
