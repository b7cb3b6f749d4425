"""Process sampled signals: compute rates, and find levels, load cycles, gaps and plateaus."""
