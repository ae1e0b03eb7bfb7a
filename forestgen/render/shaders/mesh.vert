// Studio light: what flat.vert does, and the surface's place and normal in world space.
#version 410 core
layout(location = 0) in vec3 position;
#ifdef NORMAL_LOC
layout(location = NORMAL_LOC) in vec3 normal;
#endif
#ifdef TEXCOORD_0_LOC
layout(location = TEXCOORD_0_LOC) in vec2 texcoord;
#endif
layout(location = INST_M_LOC) in mat4 place;

uniform mat4 M;
uniform mat4 V;
uniform mat4 P;
uniform mat4 sun_matrix;

out vec2 uv;
out vec3 world_normal;
out vec3 sun_place;         // in the shadow map, [0, 1]

void main() {
#ifdef TEXCOORD_0_LOC
    uv = texcoord;
#else
    uv = vec2(0.0);
#endif
    mat4 world = M * place;
    // the cofactor matrix turns normals, also where a scale differs by axis
    mat3 a = mat3(world);
    world_normal = mat3(cross(a[1], a[2]), cross(a[2], a[0]), cross(a[0], a[1])) * normal;
    vec4 point = world * vec4(position, 1.0);
    sun_place = (sun_matrix * point).xyz * 0.5 + 0.5;
    gl_Position = P * (V * point);
}
