"""Parameters from one recording."""
