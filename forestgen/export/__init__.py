"""Trees as files that are not USD: glTF binary for the web and game engines, OBJ for the rest.

`subject` is what gets exported, checked once. `glb` is glTF's container, `gltf_tree` puts a tree's
parts into it and `gltf` its nodes; `obj` writes OBJ with its materials; `places` says where instances
stand. A file appears whole or not at all.
"""
