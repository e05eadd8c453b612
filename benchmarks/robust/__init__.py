"""How the default method holds where the paper's breaks: noise, dropout, clutter, plantations, real trees.

known_places        submaps whose place is known, questions about them, and what an answer is worth
table1              loop closure in the paper's 20 cells, with its cost, beside the peers on the same pairs
grid                the extended grid of noise, detection and clutter, beside an oracle
rows                plantations, from inside and from outside of the map
few_trees           a handful of trees among hundreds of submaps
edges               plantations where another place fits nearly as well
stands              real stem maps cut into discs, re-censuses, and plots that were surveyed twice
calibration_curve   of the answers given with confidence p, how many are right
calibrate           fits the confidence to answers whose truth is known
charts, report      pictures, and the section of the page
"""
