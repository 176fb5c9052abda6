"""Rows of a trial, gathered until they are written as chunks."""
