"""A run folder: weights, the card beside them, and what is remembered of a training."""
