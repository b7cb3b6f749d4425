"""Read, check and describe the experiment spec: its sections, its loader with positions and
overrides, and its JSON Schema.
"""
