"""The method of M1 and M2: curves cut into segments, a few terms chosen for each, the pieces fused with smooth weights."""
