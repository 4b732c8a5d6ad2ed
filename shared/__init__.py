"""The contract between the packages: system description, dataset schema, store and metrics."""

__version__ = "0.1.0"
