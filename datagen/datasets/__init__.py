"""Datasets that are there: told, verified, mended, merged."""
