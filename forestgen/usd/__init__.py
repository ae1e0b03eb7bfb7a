"""The only folder that imports pxr: writes trees and scenes as USD, reads them back, validates them.

`tree_asset` and `cameras` write what one tree needs, `forest_scene` places trees, `read` turns any
stage into things to draw, `validate` asks every validator that comes with USD. Layout, names and
units are those of DESIGN section 5.
"""
