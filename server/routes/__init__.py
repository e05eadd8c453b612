"""HTTP routes, one module per resource: parameters in, one call of a service room, an answer out.

Imports everything below `app`, but neither SQL nor numpy.
"""
