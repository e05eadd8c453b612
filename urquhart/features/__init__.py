"""Features of one submap: checked landmarks, their tessellation, quads, and described polygons.

May import the ground floor only (`_kernel`, `budget`, `config`, `options`, `se2`, `trace`, `pose_covariance`).
"""
