#version 330 core
// In place of pyrender's own, whose diffuse part is 0.96 (1 - F) albedo / pi with a specular one on top, raised to
// 1/2.2 and clamped to 1. Here: linear radiance, f = albedo / pi exactly, or a rough metal; no shadows. The names of
// uniforms are pyrender's.

struct SpotLight {
    vec3 color;              // W/sr along the axis, in the scaled units of the scene
    float intensity;         // 1: falls off with the cosine, a flat lamp; 0: by pbrt's smoothstep, a spot
    vec3 position;
    vec3 direction;
    float light_angle_scale;
    float light_angle_offset;
};

struct DirectionalLight {
    vec3 color;              // W/m^2 on a surface that faces it
    vec3 direction;
};

struct PointLight {
    vec3 color;              // W/sr
    vec3 position;
};

struct Material {
    vec3 emissive_factor;    // W/(m^2 sr)
    vec4 base_color_factor;  // albedo, or a metal's reflectance at normal incidence; alpha 0: emits on both sides
    float metallic_factor;   // 0: diffuse, 1: metal
    float roughness_factor;  // alpha of the GGX distribution
};

uniform Material material;
uniform PointLight point_lights[MAX_POINT_LIGHTS];
uniform int n_point_lights;
uniform DirectionalLight directional_lights[MAX_DIRECTIONAL_LIGHTS];
uniform int n_directional_lights;
uniform SpotLight spot_lights[MAX_SPOT_LIGHTS];
uniform int n_spot_lights;
uniform vec3 cam_pos;
uniform vec3 ambient_light;

in vec3 frag_position;
in vec3 frag_normal;
out vec4 frag_color;

const float PI = 3.141592653589793;

// f cos(wi): Lambert's, or GGX with height-correlated Smith masking and Schlick's Fresnel term.
vec3 reflected(vec3 n, vec3 wo, vec3 wi)
{
    float mu_i = max(dot(n, wi), 0.0);
    if (material.metallic_factor == 0.0)
        return material.base_color_factor.rgb * mu_i / PI;
    float mu_o = max(dot(n, wo), 1e-4);
    vec3 h = normalize(wi + wo);
    float mu_h = max(dot(n, h), 0.0);
    float a2 = material.roughness_factor * material.roughness_factor;
    float q = mu_h * mu_h * (a2 - 1.0) + 1.0;
    float d = a2 / (PI * q * q);
    float v = 0.5 / (mu_i * sqrt(a2 + (1.0 - a2) * mu_o * mu_o) + mu_o * sqrt(a2 + (1.0 - a2) * mu_i * mu_i));
    vec3 f0 = material.base_color_factor.rgb;
    vec3 f = f0 + (1.0 - f0) * pow(1.0 - max(dot(wo, h), 0.0), 5.0);
    return f * d * v * mu_i;
}

void main()
{
    vec3 wo = normalize(cam_pos - frag_position);
    vec3 outward = normalize(frag_normal);
    bool front = dot(outward, wo) > 0.0;
    vec3 n = front ? outward : -outward;
    vec3 color = front || material.base_color_factor.a == 0.0 ? material.emissive_factor : vec3(0.0);
    color += material.base_color_factor.rgb * ambient_light;
    for (int i = 0; i < n_directional_lights; i++)
        color += reflected(n, wo, -directional_lights[i].direction) * directional_lights[i].color;
    for (int i = 0; i < n_point_lights; i++) {
        vec3 to = point_lights[i].position - frag_position;
        color += reflected(n, wo, normalize(to)) * point_lights[i].color / dot(to, to);
    }
    for (int i = 0; i < n_spot_lights; i++) {
        vec3 to = spot_lights[i].position - frag_position;
        vec3 wi = normalize(to);
        float c = dot(spot_lights[i].direction, -wi);
        float t = clamp(c * spot_lights[i].light_angle_scale + spot_lights[i].light_angle_offset, 0.0, 1.0);
        float falloff = spot_lights[i].intensity == 1.0 ? t : t * t * (3.0 - 2.0 * t);
        color += reflected(n, wo, wi) * falloff * spot_lights[i].color / dot(to, to);
    }
    frag_color = vec4(color, 1.0);
}
