//! Reads `MOZ_lightmap` and Hemibake's extras while Bevy loads a glTF file.

use std::{collections::HashMap, f32::consts::PI};

use bevy::{
    asset::{AssetPath, Handle, LoadContext},
    ecs::{prelude::*, reflect::ReflectComponent},
    gltf::extensions::GltfExtensionHandler,
    image::Image,
    pbr::StandardMaterial,
    reflect::Reflect,
};
use gltf::{Gltf, Material, Mesh, Primitive, Scene, Texture};
use serde::Deserialize;

use crate::manifest::Ordered;

/// A scene of a glTF file, on its root entity: what the file tells about its lightmaps.
#[derive(Component, Reflect, Clone, Debug, Default)]
#[reflect(Component)]
pub(crate) struct LightmappedScene {
    /// Path of the glTF file.
    pub path: AssetPath<'static>,
    /// Extras of the glTF asset, JSON.
    pub extras: String,
    /// Lightmaps in the file.
    pub inside: Vec<LightmapInside>,
}

/// A lightmap in a glTF file.
#[derive(Reflect, Clone, Debug, Default)]
pub(crate) struct LightmapInside {
    pub name: String,
    pub light: Option<TextureInside>,
    pub groups: Vec<GroupInside>,
}

/// Map of a light group in a glTF file.
#[derive(Reflect, Clone, Debug, Default)]
pub(crate) struct GroupInside {
    pub name: String,
    pub texture: Option<TextureInside>,
}

/// A texture whose texels are multiplied by the intensity to get irradiance / π.
#[derive(Reflect, Clone, Debug, Default)]
pub(crate) struct TextureInside {
    pub image: Handle<Image>,
    pub intensity: f32,
}

/// A surface of a glTF file: index of its lightmap in [`LightmappedScene::inside`].
#[derive(Component, Reflect, Clone, Debug, Default)]
#[reflect(Component)]
pub(crate) struct LightmapIndex(pub usize);

/// Extension `MOZ_lightmap` of a material, and a light group in its extras.
#[derive(Deserialize)]
struct MozLightmap {
    index: usize,
    #[serde(default = "one")]
    intensity: f32,
    #[serde(default)]
    extras: MozExtras,
}

#[derive(Deserialize, Default)]
struct MozExtras {
    #[serde(default)]
    hemibake: MozGroups,
}

#[derive(Deserialize, Default)]
struct MozGroups {
    #[serde(default)]
    groups: Ordered<MozGroup>,
}

#[derive(Deserialize)]
struct MozGroup {
    index: usize,
    #[serde(default = "one")]
    intensity: f32,
}

fn one() -> f32 {
    1.0
}

/// Handler of `MOZ_lightmap`; Bevy clones it for each glTF file.
#[derive(Clone, Default)]
pub(crate) struct GltfLightmaps {
    extras: String,
    textures: HashMap<usize, (String, Handle<Image>)>,
    inside: Vec<LightmapInside>,
    lightmaps: HashMap<usize, usize>,
    materials: HashMap<usize, usize>,
}

impl GltfLightmaps {
    fn texture(&self, index: usize, intensity: f32) -> Option<TextureInside> {
        let (_, image) = self.textures.get(&index)?;
        Some(TextureInside {
            image: image.clone(),
            intensity: intensity / PI,
        })
    }

    /// Returns the index of a lightmap, which several materials may have.
    fn lightmap(&mut self, known: &MozLightmap) -> usize {
        if let Some(index) = self.lightmaps.get(&known.index) {
            return *index;
        }
        let named = self
            .textures
            .get(&known.index)
            .map(|(name, _)| name.clone());
        let groups = known.extras.hemibake.groups.0.iter();
        self.inside.push(LightmapInside {
            name: named.unwrap_or_else(|| format!("Texture {}", known.index)),
            light: self.texture(known.index, known.intensity),
            groups: groups
                .map(|(name, group)| GroupInside {
                    name: name.clone(),
                    texture: self.texture(group.index, group.intensity),
                })
                .collect(),
        });
        self.lightmaps.insert(known.index, self.inside.len() - 1);
        self.inside.len() - 1
    }
}

impl GltfExtensionHandler for GltfLightmaps {
    fn dyn_clone(&self) -> Box<dyn GltfExtensionHandler> {
        Box::new(self.clone())
    }

    fn on_root(&mut self, gltf: &Gltf) {
        let extras = gltf.document.as_json().asset.extras.as_ref();
        self.extras = extras.map(|extras| extras.get().into()).unwrap_or_default();
    }

    fn on_texture(&mut self, texture: &Texture, image: Handle<Image>) {
        let name = texture
            .name()
            .map_or_else(|| format!("Texture {}", texture.index()), String::from);
        self.textures.insert(texture.index(), (name, image));
    }

    fn on_material(
        &mut self,
        _: &mut LoadContext<'_>,
        material: &Material,
        _: Handle<StandardMaterial>,
    ) {
        let known = material.extension_value("MOZ_lightmap").cloned();
        let known = known.and_then(|value| serde_json::from_value::<MozLightmap>(value).ok());
        if let (Some(known), Some(index)) = (known, material.index()) {
            let lightmap = self.lightmap(&known);
            self.materials.insert(index, lightmap);
        }
    }

    fn on_spawn_mesh_and_material(
        &mut self,
        _: &mut LoadContext<'_>,
        _: &Primitive,
        _: &Mesh,
        material: &Material,
        surface: &mut EntityWorldMut,
    ) {
        if let Some(lightmap) = material
            .index()
            .and_then(|index| self.materials.get(&index))
        {
            surface.insert(LightmapIndex(*lightmap));
        }
    }

    fn on_scene_completed(
        &mut self,
        context: &mut LoadContext<'_>,
        _: &Scene,
        root: Entity,
        world: &mut World,
    ) {
        world.entity_mut(root).insert(LightmappedScene {
            path: context.path().clone().without_label().into_owned(),
            extras: self.extras.clone(),
            inside: self.inside.clone(),
        });
    }
}
