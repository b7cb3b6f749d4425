"""Models that are added up, as a static and a damping model (M2 section 3)."""
