"""A dataset from many workers: planned, dispatched, collected, resumed."""
