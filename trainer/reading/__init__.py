"""Windows over shards, and how an estimator reads them."""
