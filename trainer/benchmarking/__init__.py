"""The benchmark: the paper's tables and figures, and past them, over many fits."""
