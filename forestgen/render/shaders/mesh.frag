// Studio light: a soft sun with shadows, and a sky that is brighter above and dimmer inside the crown.
// Every surface is lit from both sides; leaves also let light through. Light is found once a pixel, what is
// cut out once a sample.
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
uniform vec3 sun_toward;
uniform sampler2D sun_depth;  // clip depth in 16 bits, red the upper eight
in vec2 uv;
in vec3 world_normal;
in vec3 sun_place;
out vec4 colour;

const int SAMPLES = 4;
const int TAPS = 8;           // of the shadow map
const float SPREAD = 0.012;   // radius of the penumbra, share of the map
const float BIAS = 0.006;     // share of the depth range

vec3 to_linear(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c)); }
vec3 to_srgb(vec3 c) { return mix(c * 12.92, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }

// x: share of the sun that arrives; y: share of the sky, less the deeper the point lies behind the crown's surface
vec2 light_that_arrives() {
    float turn = 6.2831853 * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    float open = 0.0, inside = 0.0;
    for (int k = 0; k < TAPS; ++k) {
        float angle = turn + 2.3999632 * float(k);
        vec2 step_aside = SPREAD * sqrt((float(k) + 0.5) / float(TAPS)) * vec2(cos(angle), sin(angle));
        float first = dot(texture(sun_depth, sun_place.xy + step_aside).rg, vec2(256.0, 1.0)) * 255.0 / 65535.0;
        float behind = sun_place.z - BIAS - first;
        open += behind <= 0.0 ? 1.0 : 0.0;
        inside += max(behind, 0.0);
    }
    return vec2(open, 0.0) / float(TAPS) + vec2(0.0, exp(-3.0 * inside / float(TAPS)));
}

// The samples, a bit each, where alpha reaches the threshold.
// Alpha is read from the texture's full resolution: smaller mip levels would thicken or thin leaves.
int samples_there(float alpha) {
#ifdef HAS_BASE_COLOR_TEX
    int there = 0;
    for (int k = 0; k < SAMPLES; ++k) {
        vec2 place = interpolateAtSample(uv, k);
        if (alpha * textureLod(material.base_color_texture, place, 0.0).a >= material.metallic_factor) there |= 1 << k;
    }
    return there;
#else
    return alpha < material.metallic_factor ? 0 : ~0;
#endif
}

void main() {
    vec4 base = material.base_color_factor;
    int there = samples_there(base.a);
    if (there == 0) discard;
    gl_SampleMask[0] = there;
#ifdef HAS_BASE_COLOR_TEX
    base.rgb *= texture(material.base_color_texture, uv).rgb;
#endif
    vec3 n = normalize(world_normal);
    if (dot(n, transpose(mat3(V)) * vec3(0.0, 0.0, 1.0)) < 0.0) n = -n;
    float facing = dot(n, sun_toward);
    float lit = mix(max(facing, 0.0), 0.35 + 0.65 * abs(facing), 0.8 * material.roughness_factor);
    vec2 arrives = light_that_arrives();
    float sky = 0.5 + 0.5 * n.y;
    vec3 light = vec3(1.0, 0.96, 0.88) * 1.35 * lit * arrives.x
               + mix(vec3(0.40, 0.39, 0.36), vec3(0.62, 0.68, 0.76), sky) * mix(0.45, 1.0, arrives.y);
    colour = vec4(to_srgb(clamp(to_linear(base.rgb) * light, 0.0, 1.0)), 1.0);
}
