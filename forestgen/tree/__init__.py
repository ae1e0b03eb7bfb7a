"""From photo to tree. Knows nothing of scenes or USD.

Types are at the bottom (photo, strokes, mattes, branches, skeleton, view, model), then what several
stages share (colour_model, ...), then the stages, each a folder with its contract in `__init__`
and one file per algorithm, then `methods`, the only file that names the papers.
"""
