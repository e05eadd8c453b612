"""`make bench-maps`: false loops, drift and trees of maps, in simulation and on real stem maps; see docs/maps.md."""
