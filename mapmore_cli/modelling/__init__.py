"""The method and its competitors, on arrays alone."""
