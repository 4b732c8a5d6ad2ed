"""What an estimator reaches, under both protocols."""
