"""The paper's experiments, each by one command: `python -m benchmarks.paper` (`make bench-paper`).

drive                    a simulated forest, a robot driving in a circle, pairs of observations and their truth
methods                  the methods compared, behind one small interface
attempts                 every pair tried with a method, and what three ways of scoring make of it
table1, pr_curves        loop closure: 20 cells of noise and detection; precision and recall
ablation                 the choices the paper leaves open, each measured
tracks, table2           map merging on real stem maps
table3                   what describing and matching cost
published                the figures of the letter
pool, record             two processes, progress, JSON with machine, seed and command
charts, report           pictures, and docs/results.md from the JSON alone
"""
