"""Parameters and a nuisance from a recording by simulation: :func:`diagnosis.fitting.fit.fit` of a :class:`Problem`."""
