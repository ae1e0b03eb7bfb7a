"""Trees as files that are not USD: glTF binary for the web and game engines, OBJ for the rest.

`subject` is what gets exported, checked once; `glb` is the container, `gltf` fills it; `obj` writes
OBJ with its materials. A file appears whole or not at all.
"""
