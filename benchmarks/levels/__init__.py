"""What each level of the search adds in right answers, and what it costs in time, in every world of the benchmarks.

cases       the worlds of the other benchmarks, and what is asked of each
asking      one question, level by level, and again without each level that others do not build on
summary     from the rows of many questions to figures
report      the section of the page
"""
