"""Fitting an estimator to a dataset, and searching for its options."""
