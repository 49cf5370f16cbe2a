"""What a scene's module is written from: the graph of its right-hand side, and the source text of its parts.

Faces: `expression` (what a right-hand side may use), `tangent` (its derivatives), `template`, and a file for each part
of a module: `series`, `leg`, `driver`, `lane`, `error`, `hidden`, `rounding`, `sliding`, `stiff`. `codegen` puts them
together.
"""
