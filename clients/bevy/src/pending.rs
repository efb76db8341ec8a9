//! Lightmaps whose maps are being loaded, and what they become.

use std::mem::take;

use bevy::{
    asset::{AssetPath, prelude::*},
    ecs::prelude::*,
    image::Image,
    math::{Rect, UVec2},
    render::render_resource::TextureFormat,
};

use crate::{
    directional::{DIRECTIONAL, DirectionalMaps},
    gltf_lightmaps::{LightmapInside, TextureInside},
    manifest::{Atlas, MapFile, States},
    map_files::{Decode, MapState, PendingMap},
    mixing::{MapLayer, MixedLightmap, target_image},
    probes::PendingVolume,
};

/// A scene whose maps are being loaded.
#[derive(Component, Default)]
pub(crate) struct Loading {
    pub lightmaps: Vec<PendingLightmap>,
    pub surfaces: Vec<Surface>,
    pub volumes: Vec<PendingVolume>,
    pub states: States,
    pub problems: Vec<String>,
}

/// A mesh with a lightmap, by its index.
pub(crate) struct Surface {
    pub entity: Entity,
    pub lightmap: usize,
    pub uv_rect: Rect,
}

/// A lightmap whose maps are being loaded.
#[derive(Default)]
pub(crate) struct PendingLightmap {
    pub name: String,
    light: Option<PendingMap>,
    groups: Vec<(String, PendingMap)>,
    directional: Option<PendingDirections>,
    /// Shown if no map is readable.
    pub instead: Option<Box<PendingLightmap>>,
}

/// Directional maps, by the index of their outputs in [`DIRECTIONAL`].
struct PendingDirections {
    kind: usize,
    maps: [PendingMap; 4],
}

/// A lightmap as it is shown: its image, and what is drawn into images.
pub(crate) struct ShownLightmap {
    pub image: Handle<Image>,
    pub directional: Option<DirectionalMaps>,
    pub groups: Vec<String>,
    pub mixed: Vec<MixedLightmap>,
}

impl Loading {
    /// Returns true while maps are being loaded.
    pub fn poll(&mut self, server: &AssetServer, images: &mut Assets<Image>) -> bool {
        let volumes = self.volumes.iter_mut().map(|volume| &mut volume.map);
        let maps = self
            .lightmaps
            .iter_mut()
            .flat_map(PendingLightmap::maps)
            .chain(volumes);
        let mut is_loading = false;
        for map in maps {
            map.poll(server, images);
            is_loading |= map.state == MapState::Loading;
        }
        is_loading
    }

    /// Returns each lightmap as it is shown; None if none of its maps is readable.
    pub fn shown(&mut self, images: &mut Assets<Image>) -> Vec<Option<ShownLightmap>> {
        let mut problems = take(&mut self.problems);
        let shown = self
            .lightmaps
            .iter()
            .map(|lightmap| lightmap.shown(images, &mut problems))
            .collect();
        self.problems = problems;
        shown
    }
}

impl PendingLightmap {
    /// Starts to load the files of a lightmap; with directional maps if asked for.
    pub fn beside(
        atlas: &Atlas,
        server: &AssetServer,
        folder: &AssetPath<'static>,
        directional: bool,
    ) -> Self {
        let load = |map: &MapFile| PendingMap::load(server, folder, map);
        let directional = if directional {
            directions(atlas, load)
        } else {
            None
        };
        // Light groups add up to all light.
        let needs_light = atlas.groups.is_empty() || directional.is_some();
        Self {
            name: atlas.name.clone(),
            light: atlas.light.as_ref().filter(|_| needs_light).map(load),
            groups: atlas
                .groups
                .iter()
                .map(|(name, map)| (name.clone(), load(map)))
                .collect(),
            directional,
            instead: None,
        }
    }

    /// Takes the textures of a lightmap in the glTF file.
    pub fn inside(lightmap: &LightmapInside) -> Self {
        let take = |name: &str, texture: &Option<TextureInside>| {
            PendingMap::inside(
                name,
                texture
                    .as_ref()
                    .map(|texture| (texture.image.clone(), texture.intensity)),
            )
        };
        let name = &lightmap.name;
        let group = |group: &str| format!("{name} {group}");
        let groups = lightmap.groups.iter();
        Self {
            name: name.clone(),
            light: lightmap
                .groups
                .is_empty()
                .then(|| take(name, &lightmap.light)),
            groups: groups
                .map(|map| (map.name.clone(), take(&group(&map.name), &map.texture)))
                .collect(),
            ..Self::default()
        }
    }

    fn maps(&mut self) -> Vec<&mut PendingMap> {
        let own = self
            .light
            .iter_mut()
            .chain(self.groups.iter_mut().map(|(_, map)| map));
        let directional = self
            .directional
            .iter_mut()
            .flat_map(|directional| &mut directional.maps);
        own.chain(directional)
            .chain(self.instead.iter_mut().flat_map(|other| other.maps()))
            .collect()
    }

    fn shown(
        &self,
        images: &mut Assets<Image>,
        problems: &mut Vec<String>,
    ) -> Option<ShownLightmap> {
        let mut readable = Readable {
            images,
            problems,
            size: None,
        };
        let groups: Vec<_> = self
            .groups
            .iter()
            .filter_map(|(name, map)| readable.layer(Some(name.clone()), map))
            .collect();
        let light = self
            .light
            .as_ref()
            .and_then(|map| readable.layer(None, map));
        let directional = self
            .directional
            .as_ref()
            .and_then(|directional| directional.layers(&mut readable));
        let Some(size) = readable.size else {
            return self
                .instead
                .as_ref()
                .and_then(|other| other.shown(images, problems));
        };
        let names = groups
            .iter()
            .filter_map(|layer| layer.group.clone())
            .collect();
        let mut mixes = Mixes {
            images,
            size,
            mixed: Vec::new(),
        };
        let (image, all) = if groups.is_empty() {
            let image = mixes.plain(light?);
            (image.clone(), Some(image))
        } else {
            let image = mixes.sum(groups);
            (
                image,
                light
                    .filter(|_| directional.is_some())
                    .map(|light| mixes.plain(light)),
            )
        };
        let directional = directional.zip(all).map(|((kind, maps), all)| {
            let maps = maps.map(|map| mixes.sum(vec![map]));
            DirectionalMaps { all, maps, kind }
        });
        Some(ShownLightmap {
            image,
            directional,
            groups: names,
            mixed: mixes.mixed,
        })
    }
}

/// Starts to load directional maps; None if the atlas has not all of one kind.
fn directions(atlas: &Atlas, load: impl Fn(&MapFile) -> PendingMap) -> Option<PendingDirections> {
    let find = |output: &str| {
        atlas
            .directional
            .iter()
            .find(|(name, _)| name == output)
            .map(|(_, map)| map)
    };
    let kind = DIRECTIONAL
        .iter()
        .position(|outputs| outputs.iter().all(|output| find(output).is_some()))?;
    let maps = DIRECTIONAL[kind].map(|output| load(find(output).expect("a map of each output")));
    Some(PendingDirections { kind, maps })
}

impl PendingDirections {
    fn layers(&self, readable: &mut Readable) -> Option<(usize, [MapLayer; 4])> {
        let maps: Vec<_> = self
            .maps
            .iter()
            .filter_map(|map| readable.layer(None, map))
            .collect();
        Some((self.kind, maps.try_into().ok()?))
    }
}

/// Collects readable maps of one size, and problems of the others.
struct Readable<'a> {
    images: &'a Assets<Image>,
    problems: &'a mut Vec<String>,
    size: Option<UVec2>,
}

impl Readable<'_> {
    fn layer(&mut self, group: Option<String>, map: &PendingMap) -> Option<MapLayer> {
        let size = self.images.get(&map.image).map(Image::size);
        let fault = match (&map.state, size) {
            (MapState::Failed(reason), _) => format!("not readable ({reason})"),
            (_, Some(size)) if size == *self.size.get_or_insert(size) => {
                return Some(MapLayer {
                    group,
                    image: map.image.clone(),
                    decode: map.decode,
                });
            }
            _ => "not as large as the other maps of its lightmap".into(),
        };
        self.problems.push(format!(
            "{}: {fault}. Put it beside the glTF file, or export again.",
            map.file
        ));
        None
    }
}

/// Images that are drawn for a lightmap.
struct Mixes<'a> {
    images: &'a mut Assets<Image>,
    size: UVec2,
    mixed: Vec<MixedLightmap>,
}

impl Mixes<'_> {
    /// Returns an image of the sum of maps.
    fn sum(&mut self, layers: Vec<MapLayer>) -> Handle<Image> {
        let target = self.images.add(target_image(self.size));
        self.mixed.push(MixedLightmap::new(target.clone(), layers));
        target
    }

    /// Returns an image of one map: the map itself if all devices can filter its light.
    fn plain(&mut self, map: MapLayer) -> Handle<Image> {
        let format = self
            .images
            .get(&map.image)
            .map(|image| image.texture_descriptor.format);
        if map.decode == Decode::linear(1.0) && format == Some(TextureFormat::Rgb9e5Ufloat) {
            return map.image;
        }
        self.sum(vec![map])
    }
}
