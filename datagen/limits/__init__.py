"""What a recording can tell at all: sensitivities, and the limit of R2 that follows."""
