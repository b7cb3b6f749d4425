"""Parts that a study can do without. Each adds itself as a plug-in does."""
