"""Keep the shape that is known of a surface, as a force that rises with pressure."""
