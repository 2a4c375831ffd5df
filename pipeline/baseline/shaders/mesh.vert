#version 330 core
// In place of pyrender's own: positions and normals as they are, with no more than what mesh.frag needs.
layout(location = 0) in vec3 position;
layout(location = NORMAL_LOC) in vec3 normal;
layout(location = INST_M_LOC) in mat4 inst_m;

uniform mat4 M;
uniform mat4 V;
uniform mat4 P;

out vec3 frag_position;
out vec3 frag_normal;

void main()
{
    vec4 p = M * inst_m * vec4(position, 1.0);
    gl_Position = P * V * p;
    frag_position = p.xyz;
    frag_normal = normal;
}
