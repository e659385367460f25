"""Tasks x = f(q)."""
