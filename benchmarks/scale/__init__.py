"""How the database grows: one command (`make bench-scale`) from a thousand submaps to a million.

tiled_forest            a forest in tiles, any place of which can be seen without the rest; who is where in it
observations            many observations in one file
measurement, worker     one measurement of one size, in a process of its own
measurement_plan        every measurement, what comes before it, and for which sizes
other_load              what else the machine did meanwhile
simulate                what is stored and what is asked, made before anything is timed
database                the two places that know how submaps are stored at once, and what an index takes on the disk
ingest, start, asking, threads, http_overhead
                        storing, starting, queries and their answers, two at a time, over HTTP
rivals/                 other ways to find submaps worth verifying, on the same submaps and queries
requirements            figures to reach, and why one is missed
charts, report          pictures, and docs/scaling.md from the JSON alone
"""
