"""Runs of a study."""
