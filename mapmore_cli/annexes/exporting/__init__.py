"""Write models in C, JavaScript, MATLAB, Python and LaTeX, and as FMUs and lookup tables."""
