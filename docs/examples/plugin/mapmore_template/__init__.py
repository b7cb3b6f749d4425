"""Parts for `mapmore`, one file each."""
