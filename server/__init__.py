"""The service: a place-recognition database for forests, over HTTP and on the command line."""
