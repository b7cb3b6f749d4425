"""Define the frozen types that pass between the layers, and the errors that users see."""
