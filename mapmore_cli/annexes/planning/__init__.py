"""Compare settings of a model, and decide what to measure next."""
