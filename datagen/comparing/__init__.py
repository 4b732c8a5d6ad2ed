"""Two models of one system held against each other, or one against recorded series."""
