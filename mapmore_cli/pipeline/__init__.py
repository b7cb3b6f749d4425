"""Run the stages: fingerprints, staleness, runs that need other runs, and the runner."""
