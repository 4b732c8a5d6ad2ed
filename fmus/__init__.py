"""The default FMU: sources, build and system description."""
