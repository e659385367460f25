"""Reads results only: figures, reports, tables, animations."""
