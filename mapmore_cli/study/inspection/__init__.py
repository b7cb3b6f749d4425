"""What the data say about themselves and about their spec: evidence, and the rules that `mapmore check` applies."""
