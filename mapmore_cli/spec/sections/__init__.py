"""The sections of an experiment spec, a module each: what a YAML file may say there, with the
defaults.
"""
