// The sun's view: places instances.
#version 410 core
layout(location = 0) in vec3 position;
#ifdef TEXCOORD_0_LOC
layout(location = TEXCOORD_0_LOC) in vec2 texcoord;
#endif
layout(location = INST_M_LOC) in mat4 place;

uniform mat4 M;
uniform mat4 V;
uniform mat4 P;

out vec2 uv;

void main() {
#ifdef TEXCOORD_0_LOC
    uv = texcoord;
#else
    uv = vec2(0.0);
#endif
    gl_Position = P * (V * (M * (place * vec4(position, 1.0))));
}
