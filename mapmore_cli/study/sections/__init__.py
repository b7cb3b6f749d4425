"""The sections of a spec, a module each."""
