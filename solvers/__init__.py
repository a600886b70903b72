"""Solvers, one file a method: frozen values with a ``solve`` method, composable."""
