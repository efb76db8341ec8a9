// Light of a normal map by the maps of Directional, as described in docs/engines/bevy.md.
#import bevy_pbr::{
    forward_io::{FragmentOutput, VertexOutput},
    pbr_fragment::pbr_input_from_standard_material,
    pbr_functions::{apply_pbr_lighting, main_pass_post_lighting_processing},
}

@group(#{MATERIAL_BIND_GROUP}) @binding(100) var l0: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(101) var maps_sampler: sampler;
@group(#{MATERIAL_BIND_GROUP}) @binding(102) var l1_x: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(103) var l1_y: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(104) var l1_z: texture_2d<f32>;

@fragment
fn fragment(in: VertexOutput, @builtin(front_facing) is_front: bool) -> FragmentOutput {
    var pbr_input = pbr_input_from_standard_material(in, is_front);
    let n = pbr_input.N;
    let light = textureSample(l0, maps_sampler, in.uv_b).rgb
        + n.x * textureSample(l1_x, maps_sampler, in.uv_b).rgb
        - n.z * textureSample(l1_y, maps_sampler, in.uv_b).rgb
        + n.y * textureSample(l1_z, maps_sampler, in.uv_b).rgb;
    let shown = pbr_input.material.base_color.rgb * max(light, vec3(0.0)) + pbr_input.material.emissive.rgb;
    pbr_input.material.emissive = vec4(shown, 0.0);
    var out: FragmentOutput;
    out.color = main_pass_post_lighting_processing(pbr_input, apply_pbr_lighting(pbr_input));
    return out;
}
