"""How the database grows: one command (`make bench-scale`) from a thousand submaps to a million.

world           a forest in tiles, any place of which can be seen without the rest; who is where in it
observations    many observations in one file
job, worker     one measurement of one size, in a process of its own; `parts` lists them
others          what else the machine did meanwhile
simulate        what is stored and what is asked, made before anything is timed
database        the two places that know how submaps are stored at once, and what an index takes on the disk
ingest, start, asking, threads, service
                storing, starting, queries and their answers, two at a time, over HTTP
rivals/         other ways to find submaps worth verifying, on the same submaps and queries
requirements    figures to reach, and why one is missed
plots, report   pictures, and docs/scaling.md from the JSON alone
"""
