"""Simulated recordings that the project ships, and the rig that made them (`datasets/rig`)."""
