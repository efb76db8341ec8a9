// Light of a normal map by directional maps: E(n') / pi of the normal n' of the normal map at the surface normal n.
#import bevy_pbr::{
    forward_io::{FragmentOutput, VertexOutput},
    pbr_fragment::pbr_input_from_standard_material,
    pbr_functions::{alpha_discard, apply_pbr_lighting, main_pass_post_lighting_processing},
}

struct Place {
    // Corners of the rectangle that lightmap UVs are relative to.
    uv_rect: vec4<f32>,
    // 1 if the maps are spherical harmonics, relative to their L0.
    is_relative: u32,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(100) var<uniform> place: Place;
@group(#{MATERIAL_BIND_GROUP}) @binding(101) var all: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(102) var maps_sampler: sampler;
@group(#{MATERIAL_BIND_GROUP}) @binding(103) var l0: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(104) var l1_x: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(105) var l1_y: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(106) var l1_z: texture_2d<f32>;

// The maps have Blender's axes: (x, -z, y) of Bevy.
fn along_l1(n: vec3<f32>, uv: vec2<f32>) -> vec3<f32> {
    return n.x * textureSampleLevel(l1_x, maps_sampler, uv, 0.0).rgb
        - n.z * textureSampleLevel(l1_y, maps_sampler, uv, 0.0).rgb
        + n.y * textureSampleLevel(l1_z, maps_sampler, uv, 0.0).rgb;
}

// Factor from the light at the surface normal to the light at the normal of the normal map. A mix of light groups
// scales L0 and L1 alike, so the factor holds for all light states.
fn light_ratio(uv_b: vec2<f32>, mapped: vec3<f32>, surface: vec3<f32>) -> vec3<f32> {
    let uv = mix(place.uv_rect.xy, place.uv_rect.zw, uv_b);
    let light = textureSampleLevel(all, maps_sampler, uv, 0.0).rgb;
    var bent: vec3<f32>;
    if place.is_relative == 1u {
        bent = textureSampleLevel(l0, maps_sampler, uv, 0.0).rgb * (1.0 + 2.0 * along_l1(mapped, uv));
    } else {
        bent = light + along_l1(mapped - surface, uv);
    }
    return select(vec3(0.0), max(bent, vec3(0.0)) / max(light, vec3(1e-20)), light > vec3(0.0));
}

@fragment
fn fragment(in: VertexOutput, @builtin(front_facing) is_front: bool) -> FragmentOutput {
    var pbr_input = pbr_input_from_standard_material(in, is_front);
    pbr_input.material.base_color = alpha_discard(pbr_input.material, pbr_input.material.base_color);
#ifdef LIGHTMAP
    pbr_input.lightmap_light *= light_ratio(in.uv_b, pbr_input.N, pbr_input.world_normal);
#endif
    var out: FragmentOutput;
    out.color = main_pass_post_lighting_processing(pbr_input, apply_pbr_lighting(pbr_input));
    return out;
}
