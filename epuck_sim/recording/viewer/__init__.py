"""Rerun's viewer: its process, a saved recording, a live trial."""
