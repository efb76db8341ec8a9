//! Materials whose normal maps are shaded with directional maps.

use bevy::{
    app::{App, Plugin},
    asset::{Asset, Handle, embedded_asset},
    image::Image,
    math::{Rect, Vec4},
    pbr::{ExtendedMaterial, MaterialExtension, MaterialPlugin, StandardMaterial},
    reflect::TypePath,
    render::render_resource::{AsBindGroup, ShaderType},
    shader::ShaderRef,
};

/// Outputs of directional maps, L0 first: of *Directional*, and of *Spherical Harmonics*, whose L1 is relative to L0.
pub(crate) const DIRECTIONAL: [[&str; 4]; 2] = [
    ["L0", "L1 x", "L1 y", "L1 z"],
    ["SH L0", "SH L1 x", "SH L1 y", "SH L1 z"],
];

/// Material of surfaces with a normal map in scenes with directional maps. It replaces `StandardMaterial`, which is its
/// `base`.
pub type DirectionalMaterial = ExtendedMaterial<StandardMaterial, DirectionalLight>;

/// Directional maps of a lightmap.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
pub struct DirectionalLight {
    #[uniform(100)]
    place: Place,
    #[texture(101)]
    #[sampler(102)]
    all: Handle<Image>,
    #[texture(103)]
    l0: Handle<Image>,
    #[texture(104)]
    l1_x: Handle<Image>,
    #[texture(105)]
    l1_y: Handle<Image>,
    #[texture(106)]
    l1_z: Handle<Image>,
}

/// Uniforms of `directional.wgsl`.
#[derive(ShaderType, Clone, Debug)]
struct Place {
    uv_rect: Vec4,
    is_relative: u32,
}

/// Directional maps of a lightmap, and the map of all its light.
#[derive(Clone)]
pub(crate) struct DirectionalMaps {
    /// All light, without factors of light groups.
    pub all: Handle<Image>,
    /// L0 and L1 along x, y and z.
    pub maps: [Handle<Image>; 4],
    /// Index of the outputs in [`DIRECTIONAL`].
    pub kind: usize,
}

impl DirectionalMaps {
    /// Returns the extension of a material, for UVs that are relative to a rectangle.
    pub fn light(&self, uv_rect: Rect) -> DirectionalLight {
        let [l0, l1_x, l1_y, l1_z] = self.maps.clone();
        let uv_rect = Vec4::new(uv_rect.min.x, uv_rect.min.y, uv_rect.max.x, uv_rect.max.y);
        let place = Place {
            uv_rect,
            is_relative: self.kind as u32,
        };
        DirectionalLight {
            place,
            all: self.all.clone(),
            l0,
            l1_x,
            l1_y,
            l1_z,
        }
    }
}

impl MaterialExtension for DirectionalLight {
    fn fragment_shader() -> ShaderRef {
        "embedded://bevy_hemibake/directional.wgsl".into()
    }
}

pub(crate) struct DirectionalPlugin;

impl Plugin for DirectionalPlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "directional.wgsl");
        app.add_plugins(MaterialPlugin::<DirectionalMaterial>::default());
    }
}
