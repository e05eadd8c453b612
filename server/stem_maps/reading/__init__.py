"""Tables read as trees: what columns mean, where trees stand, in which unit and system, and whether it is plausible."""
