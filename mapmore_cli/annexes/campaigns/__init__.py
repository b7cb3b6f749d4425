"""Implement `mapmore batch`: run many specs at the same time, and compare their scores."""
