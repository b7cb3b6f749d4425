"""What runs the stages: fingerprints, staleness, runs that need others, the runner."""
