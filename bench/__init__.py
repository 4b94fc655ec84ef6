"""Measurements: error against converged references, time beside it. No OpenGL calls of its own."""
