"""Published papers beside our runs: numbers side by side, verdicts by declared rules, and one page."""
