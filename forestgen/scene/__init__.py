"""Where trees stand. Knows nothing of USD.

`manifest` reads scene.toml, `paths` keeps it inside the scene's root, `names` makes prim names,
`forest` places trees and copies.
"""
