"""Measurement models of the factor graph, one file each: what an author writes is a residual and its sampler."""
