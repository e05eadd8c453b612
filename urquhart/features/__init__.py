"""Features of one submap: checked landmarks, their tessellation, quads, and described polygons.

May import the ground floor only (`_kernel`, `budget`, `config`, `se2`, `trace`, `uncertainty`).
"""
