"""The benchmark: the paper's tables and figures, and past them, over many fits.

conditions   what is fitted: one estimator under one condition, seed by seed
parts        the tables and figures, each a list of conditions
job          one fit and its score, in a run folder of its own
running      all fits of the chosen parts, resumable, side by side as processes
gathering    the finished fits of a condition: mean, spread over seeds, intervals by system
tables       a part as CSV and Markdown
drawing      a part as a figure
page         results.md, which joins them
published    another work's figures beside ours, from a JSON file
"""
