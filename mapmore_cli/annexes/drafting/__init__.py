"""Draft a spec for a folder of recordings: `mapmore init`."""
