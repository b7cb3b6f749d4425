"""Define the sections of a spec, one module for each."""
