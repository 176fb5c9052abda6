"""Rows of a trial, gathered in memory until they are written as chunks."""
