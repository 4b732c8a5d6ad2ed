"""The real Modelica model: our package on the Buildings library, scripts that export it, and their check."""
