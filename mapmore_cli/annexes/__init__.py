"""Parts that a study can do without: each adds its commands, kinds and figures as a plug-in
does.
"""
