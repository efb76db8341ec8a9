// Decodes one map of a lightmap and multiplies it by a factor; blending adds up the maps.
#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput

struct Layer {
    weight: vec3<f32>,
    intensity: f32,
    gamma: f32,
    decode: u32,
}

@group(0) @binding(0) var<uniform> layer: Layer;
@group(0) @binding(1) var map: texture_2d<f32>;

// Light of a texel; the numbers are of DecodeKind. docs/reference/formats.md has the formulas.
fn decoded(texel: vec4<f32>) -> vec3<f32> {
    let rgb = texel.rgb;
    switch layer.decode {
        case 1u: {
            let curve = pow((rgb + 0.055) / 1.055, vec3(2.4));
            return layer.intensity * select(rgb / 12.92, curve, rgb > vec3(0.04045));
        }
        case 2u: {
            return layer.intensity * pow(rgb * texel.a, vec3(layer.gamma));
        }
        case 3u: {
            return layer.intensity * pow(rgb, vec3(layer.gamma)) / texel.a;
        }
        case 4u: {
            let level = 65280.0 * rgb.r + 255.0 * rgb.g;
            let y = select(exp2((level + 0.5) / 256.0 - 64.0), 0.0, level == 0.0);
            let u = (255.0 * rgb.b + 0.5) / 410.0;
            let v = (255.0 * texel.a + 0.5) / 410.0;
            let from_xyz = mat3x3<f32>(
                3.240970, -0.969244, 0.055630, -1.537383, 1.875967, -0.203977, -0.498611, 0.041555, 1.056971,
            );
            let xyz = vec3(y * 9.0 * u / (4.0 * v), y, y * (12.0 - 3.0 * u - 20.0 * v) / (4.0 * v));
            return layer.intensity * max(from_xyz * xyz, vec3(0.0));
        }
        case 5u: {
            let raw = select(12.92 * rgb, 1.055 * pow(rgb, vec3(1.0 / 2.4)) - 0.055, rgb > vec3(0.0031308));
            return layer.intensity * raw;
        }
        case 6u: {
            return layer.intensity * (2.0 * rgb - 1.0);
        }
        default: {
            return layer.intensity * rgb;
        }
    }
}

@fragment
fn fragment(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let texel = textureLoad(map, vec2<i32>(in.position.xy), 0);
    return vec4(layer.weight * decoded(texel), 1.0);
}
