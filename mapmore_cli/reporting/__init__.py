"""Make the tables, the figures and the page of a run."""
