// Studio light: a soft sun over the viewer's left shoulder and a sky that is brighter above.
// Every surface is lit from both sides; leaves also let light through.
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
uniform mat4 V;
sample in vec2 uv;
in vec3 world_normal;
out vec4 colour;

const vec3 SUN_FROM_VIEWER = normalize(vec3(-0.55, 0.7, 0.6));

vec3 to_linear(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c)); }
vec3 to_srgb(vec3 c) { return mix(c * 12.92, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }

void main() {
    vec4 base = material.base_color_factor;
#ifdef HAS_BASE_COLOR_TEX
    base.rgb *= texture(material.base_color_texture, uv).rgb;
    base.a *= textureLod(material.base_color_texture, uv, 0.0).a;
#endif
    if (base.a < material.metallic_factor) discard;
    vec3 n = normalize(world_normal);
    vec3 toward = transpose(mat3(V)) * vec3(0.0, 0.0, 1.0);
    vec3 sun = transpose(mat3(V)) * SUN_FROM_VIEWER;
    if (dot(n, toward) < 0.0) n = -n;
    float facing = dot(n, sun);
    float lit = mix(max(facing, 0.0), 0.35 + 0.65 * abs(facing), 0.8 * material.roughness_factor);
    float sky = 0.5 + 0.5 * n.y;
    vec3 light = vec3(1.0, 0.97, 0.9) * 0.75 * lit + mix(vec3(0.30, 0.29, 0.27), vec3(0.50, 0.54, 0.60), sky);
    colour = vec4(to_srgb(clamp(to_linear(base.rgb) * light, 0.0, 1.0)), 1.0);
}
