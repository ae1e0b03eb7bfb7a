// The sun's view: only depth counts, and once a pixel is enough for soft shadows.
#version 410 core
struct Material {
    vec4 base_color_factor;
    float metallic_factor;    // carries the alpha threshold
#ifdef HAS_BASE_COLOR_TEX
    sampler2D base_color_texture;
#endif
};
uniform Material material;
in vec2 uv;

void main() {
    float alpha = material.base_color_factor.a;
#ifdef HAS_BASE_COLOR_TEX
    alpha *= textureLod(material.base_color_texture, uv, 0.0).a;
#endif
    if (alpha < material.metallic_factor) discard;
}
