"""Define the frozen dataclasses that all layers exchange, and the errors that users see."""
