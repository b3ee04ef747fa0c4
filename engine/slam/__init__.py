"""Non-Gaussian SLAM on a Bayes tree: beacons heard by range and by synthetic aperture sonar (C19 chapters 4 and 5)."""
