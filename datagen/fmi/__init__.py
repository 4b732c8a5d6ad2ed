"""What an FMU is to this package: unpacked, described, and called through its own C functions."""
