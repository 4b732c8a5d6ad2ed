"""The blind check: recordings whose effect is sealed, made by :func:`diagnosis.blind.make.make`."""
