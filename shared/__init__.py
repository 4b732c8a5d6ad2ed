"""The contract between the packages: system description, dataset schema, store and metrics."""

import os

__version__ = "0.2.0"
LOCKING = "HDF5_USE_FILE_LOCKING"
"""What HDF5 asks, once, when it is loaded: whether it locks each file that it opens. Some file systems of clusters know
no locks. Files are written here under names of their own and renamed, so that nobody needs any."""
os.environ.setdefault(LOCKING, "FALSE")
