// Unlit drawing, and beside it the picture of what is in front; run once a sample (`sample in`), so that cut-outs are as finely sampled as edges.
// Alpha is read from the texture's full resolution: smaller mip levels would thicken or thin leaves.
#version 410 core
struct Material {
    vec4 base_color_factor;
    float metallic_factor;    // carries the alpha threshold
    float roughness_factor;   // 1 for leaves
#ifdef HAS_BASE_COLOR_TEX
    sampler2D base_color_texture;
#endif
};
uniform Material material;
sample in vec2 uv;
layout(location = 0) out vec4 colour;
layout(location = 1) out vec4 front;  // red where a leaf is, green where wood is

void main() {
    vec4 base = material.base_color_factor;
#ifdef HAS_BASE_COLOR_TEX
    base.rgb *= texture(material.base_color_texture, uv).rgb;
    base.a *= textureLod(material.base_color_texture, uv, 0.0).a;
#endif
    if (base.a < material.metallic_factor) discard;
    colour = vec4(clamp(base.rgb, 0.0, 1.0), 1.0);
    front = vec4(material.roughness_factor, 1.0 - material.roughness_factor, 0.0, 1.0);
}
