"""Keep the known shape of a surface, for example a force that rises with the pressure."""
