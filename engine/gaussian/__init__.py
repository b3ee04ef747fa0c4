"""Gaussian algebra: moment and information forms, and links between two instants."""
