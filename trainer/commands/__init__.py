"""The commands: thin shells over the public functions of the same names."""
