"""A first spec for recordings that nobody has described yet: what `mapmore init` does, step by
step.
"""
