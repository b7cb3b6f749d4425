"""Keep the shape that is known of a surface, as a force that rises with pressure and falls with
strain.

`region` says where a shape is asked, `stencils` what it asks of a few neighbouring values,
`least_squares` finds the coefficients that meet it, and `violations` looks for the places where a
model does not.
"""
