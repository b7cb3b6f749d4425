"""Define the rules of `mapmore check`, which every run applies too."""
