"""Sound in the water and what is made of it: propagation, matched filter, densities, beams, synthetic arrays."""
