//! Gives the surfaces of spawned scenes their lightmaps.

use std::{
    collections::{HashMap, HashSet},
    mem::take,
};

use bevy::{
    asset::{AssetPath, prelude::*},
    ecs::{prelude::*, system::SystemParam},
    image::Image,
    log::error,
    math::{Rect, Vec2},
    mesh::{Mesh, Mesh3d, PrimitiveTopology},
    pbr::{Lightmap, Material, MeshMaterial3d, StandardMaterial},
    prelude::{ChildOf, Children, Name},
};

use crate::{
    directional::DirectionalMaterial,
    gltf_lightmaps::{LightmapIndex, LightmappedScene},
    light_control::LightControl,
    manifest::{Lightmaps, MANIFEST, Manifest, Place, lightmaps_of, read_extras},
    manifest_cache::{ManifestCache, ManifestFile},
    mixing::{MixedLightmap, MixedLightmaps},
    pending::{Loading, PendingLightmap, ShownLightmap, Surface},
    probes::{PendingVolume, ProbeVolumes},
    settings::HemibakeSettings,
};

/// All lightmaps of a scene are shown.
///
/// The event goes to the entity with [`LightControl`] and then up to its parents, so an observer of the entity with
/// [`SceneRoot`](bevy::scene::SceneRoot) receives it.
#[derive(EntityEvent, Clone, Debug)]
#[entity_event(propagate, auto_propagate)]
pub struct LightmapsReady {
    /// Entity with [`LightControl`].
    pub entity: Entity,
}

/// A message on what cannot be displayed; all else is. It is also logged as an error.
#[derive(Message, Clone, Debug)]
pub struct LightmapProblem {
    /// Entity of the scene.
    pub scene: Entity,
    /// Message that names file, state, object or volume, and the remedy.
    pub text: String,
}

/// A mesh with baked light, on the entity of its `Lightmap`.
#[derive(Component, Clone, Debug, PartialEq, Eq)]
pub struct Lightmapped {
    /// Name of the lightmap.
    pub lightmap: String,
}

/// A scene whose light has not been drawn yet.
#[derive(Component)]
pub(crate) struct Drawing;

/// Entities of spawned scenes.
#[derive(SystemParam)]
pub(crate) struct Scenes<'w, 's> {
    children: Query<'w, 's, &'static Children>,
    surfaces: Query<'w, 's, (&'static ChildOf, Option<&'static LightmapIndex>), With<Mesh3d>>,
    names: Query<'w, 's, &'static Name>,
}

impl Scenes<'_, '_> {
    /// Returns each mesh of a scene, the index of the lightmap in its material, and the name of its node.
    fn surfaces(&self, scene: Entity) -> Vec<(Entity, Option<usize>, &str)> {
        let inside = self.children.iter_descendants(scene);
        let surfaces = inside.filter_map(|entity| Some((entity, self.surfaces.get(entity).ok()?)));
        let name = |node| self.names.get(node).map_or("", Name::as_str);
        surfaces
            .map(|(entity, (node, index))| {
                (entity, index.map(|index| index.0), name(node.parent()))
            })
            .collect()
    }
}

/// Starts to load the maps of spawned scenes, once their manifest is read.
pub(crate) fn start_loading(
    mut commands: Commands,
    server: Res<AssetServer>,
    settings: Res<HemibakeSettings>,
    mut manifests: ResMut<ManifestCache>,
    spawned: Query<(Entity, &LightmappedScene)>,
    scenes: Scenes,
) {
    for (entity, scene) in &spawned {
        let folder = scene.path.parent().unwrap_or_default();
        let path = AssetPath::from_path_buf(folder.path().join(MANIFEST))
            .with_source(folder.source().clone_owned());
        let Some(manifest) = manifests.get(&server, &path) else {
            continue;
        };
        let file = scene
            .path
            .path()
            .file_name()
            .unwrap_or_default()
            .to_string_lossy();
        let mut plan = Plan::new(scene, &file, &server, &folder, &settings);
        plan.read(&manifest);
        for (surface, inside, name) in scenes.surfaces(entity) {
            plan.add(surface, inside, name);
        }
        plan.add_volumes(&manifest);
        commands
            .entity(entity)
            .remove::<LightmappedScene>()
            .insert(plan.loading);
    }
}

/// Assigns lightmaps to the surfaces of a scene.
struct Plan<'a> {
    scene: &'a LightmappedScene,
    file: &'a str,
    server: &'a AssetServer,
    folder: &'a AssetPath<'static>,
    settings: &'a HemibakeSettings,
    beside: Lightmaps,
    indices: HashMap<(Option<usize>, Option<usize>), usize>,
    unclear: HashSet<String>,
    loading: Loading,
}

impl<'a> Plan<'a> {
    fn new(
        scene: &'a LightmappedScene,
        file: &'a str,
        server: &'a AssetServer,
        folder: &'a AssetPath<'static>,
        settings: &'a HemibakeSettings,
    ) -> Self {
        let (beside, indices, unclear) = Default::default();
        Self {
            scene,
            file,
            server,
            folder,
            settings,
            beside,
            indices,
            unclear,
            loading: Loading::default(),
        }
    }

    /// Reads states and problems of the extras and of the manifest. A file without lightmaps needs no manifest.
    fn read(&mut self, manifest: &ManifestFile) {
        let extras = read_extras(&self.scene.extras, self.file).unwrap_or_else(|problem| {
            self.loading.problems.push(problem);
            None
        });
        let needs_manifest = self.scene.inside.is_empty() && extras.is_some();
        self.loading.states = extras.unwrap_or_default().states;
        match manifest {
            ManifestFile::Read(manifest) => self.read_manifest(manifest),
            ManifestFile::Faulty(problem) => self.loading.problems.push(problem.clone()),
            ManifestFile::Missing(reason) if needs_manifest => self.loading.problems.push(format!(
                "{MANIFEST}: not readable ({reason}). Put it beside '{}', or export with lightmaps inside.",
                self.file
            )),
            ManifestFile::Missing(_) => {}
        }
    }

    fn read_manifest(&mut self, manifest: &Manifest) {
        self.beside = lightmaps_of(manifest, self.file, self.settings.uvs);
        if self.loading.states.0.is_empty() {
            self.loading.states = manifest.states.clone();
        }
    }

    /// Adds the probe volumes, if the file has lightmaps: other files of the folder share the manifest.
    fn add_volumes(&mut self, manifest: &ManifestFile) {
        if let ManifestFile::Read(manifest) = manifest
            && self.settings.shows_probes
            && !self.loading.lightmaps.is_empty()
        {
            let volumes = PendingVolume::load_all(manifest, self.server, self.folder);
            self.loading.volumes.extend(volumes);
        }
    }

    /// Adds a surface if it has a lightmap.
    fn add(&mut self, entity: Entity, inside: Option<usize>, object: &str) {
        let place = self.beside.places.get(object);
        let (beside, uv_rect) = match (inside, place) {
            (Some(index), _) => {
                let name = &self.scene.inside[index].name;
                (
                    self.beside
                        .atlases
                        .iter()
                        .position(|atlas| atlas.name == *name),
                    WHOLE,
                )
            }
            (None, Some(Place::One(atlas, uv_rect))) => (Some(*atlas), *uv_rect),
            (None, Some(Place::Several)) => {
                if self.unclear.insert(object.into()) {
                    self.loading.problems.push(format!(
                        "Object '{object}': its instances have different places in lightmaps. Use Export for Engine."
                    ));
                }
                return;
            }
            (None, None) => return,
        };
        let lightmap = self.lightmap(inside, beside);
        self.loading.surfaces.push(Surface {
            entity,
            lightmap,
            uv_rect,
        });
    }

    /// Returns the index of a lightmap in the file, in files beside it, or in both.
    fn lightmap(&mut self, inside: Option<usize>, beside: Option<usize>) -> usize {
        let beside = beside.filter(|_| self.settings.prefers_files || inside.is_none());
        if let Some(index) = self.indices.get(&(inside, beside)) {
            return *index;
        }
        let inside_map = inside.map(|index| PendingLightmap::inside(&self.scene.inside[index]));
        let lightmap = match beside {
            Some(index) => {
                let mut atlas = PendingLightmap::beside(
                    &self.beside.atlases[index],
                    self.server,
                    self.folder,
                    self.settings.shades_normal_maps,
                );
                atlas.instead = inside_map.map(Box::new);
                atlas
            }
            None => inside_map.expect("a lightmap inside or beside the file"),
        };
        self.loading.lightmaps.push(lightmap);
        self.indices
            .insert((inside, beside), self.loading.lightmaps.len() - 1);
        self.loading.lightmaps.len() - 1
    }
}

const WHOLE: Rect = Rect {
    min: Vec2::ZERO,
    max: Vec2::ONE,
};

/// Assets that lightmaps need.
#[derive(SystemParam)]
pub(crate) struct Stock<'w> {
    server: Res<'w, AssetServer>,
    settings: Res<'w, HemibakeSettings>,
    images: ResMut<'w, Assets<Image>>,
    meshes: Res<'w, Assets<Mesh>>,
    standard: Res<'w, Assets<StandardMaterial>>,
    directional: ResMut<'w, Assets<DirectionalMaterial>>,
}

/// Surfaces of spawned scenes.
#[derive(SystemParam)]
pub(crate) struct Surfaces<'w, 's> {
    surfaces: Query<
        'w,
        's,
        (
            &'static Mesh3d,
            Option<&'static MeshMaterial3d<StandardMaterial>>,
            &'static ChildOf,
        ),
    >,
    names: Query<'w, 's, &'static Name>,
}

/// Starts to load the volumes of spawned [`ProbeVolumes`].
pub(crate) fn start_volumes(
    mut commands: Commands,
    server: Res<AssetServer>,
    mut manifests: ResMut<ManifestCache>,
    mut waiting: Local<Vec<Entity>>,
    spawned: Query<Entity, Added<ProbeVolumes>>,
    volumes: Query<&ProbeVolumes>,
) {
    waiting.extend(&spawned);
    waiting.retain(|entity| {
        let Ok(ProbeVolumes(path)) = volumes.get(*entity) else {
            return false;
        };
        let path = AssetPath::from(path.clone());
        let Some(manifest) = manifests.get(&server, &path) else {
            return true;
        };
        let mut loading = Loading::default();
        match manifest {
            ManifestFile::Read(manifest) => {
                let folder = path.parent().unwrap_or_default();
                loading
                    .volumes
                    .extend(PendingVolume::load_all(&manifest, &server, &folder));
            }
            ManifestFile::Faulty(problem) => loading.problems.push(problem),
            ManifestFile::Missing(reason) => {
                loading.problems.push(format!(
                    "{path}: not readable ({reason}). Name the manifest of a bake."
                ));
            }
        }
        commands.entity(*entity).insert(loading);
        false
    });
}

/// Shows the lightmaps of scenes whose maps are loaded.
pub(crate) fn finish_loading(
    mut commands: Commands,
    mut stock: Stock,
    mut messages: MessageWriter<LightmapProblem>,
    mut scenes: Query<(Entity, &mut Loading)>,
    surfaces: Surfaces,
) {
    for (scene, mut loading) in &mut scenes {
        if loading.poll(&stock.server, &mut stock.images) {
            continue;
        }
        commands.entity(scene).remove::<Loading>();
        let mut loading = take(&mut *loading);
        let lightmaps = loading.shown(&mut stock.images);
        show_surfaces(
            &mut commands,
            &mut loading,
            &lightmaps,
            &mut stock,
            &surfaces,
        );
        for volume in take(&mut loading.volumes) {
            match volume.bundle(&stock.settings) {
                Ok(volume) => drop(commands.spawn((volume, ChildOf(scene)))),
                Err(problem) => loading.problems.push(problem),
            }
        }
        if loading.lightmaps.is_empty() && loading.problems.is_empty() {
            continue;
        }
        let mut groups: Vec<String> = Vec::new();
        for group in lightmaps
            .iter()
            .flatten()
            .flat_map(|lightmap| &lightmap.groups)
        {
            if !groups.contains(group) {
                groups.push(group.clone());
            }
        }
        let light = LightControl::new(groups, loading.states, loading.problems);
        for text in light.problems() {
            error!("{text}");
            messages.write(LightmapProblem {
                scene,
                text: text.clone(),
            });
        }
        let mixed = lightmaps
            .into_iter()
            .flatten()
            .flat_map(|lightmap| lightmap.mixed);
        commands
            .entity(scene)
            .insert((light, MixedLightmaps(mixed.collect()), Drawing));
    }
}

/// Gives surfaces their lightmaps, and materials that shade normal maps with directional maps.
fn show_surfaces(
    commands: &mut Commands,
    loading: &mut Loading,
    lightmaps: &[Option<ShownLightmap>],
    stock: &mut Stock,
    surfaces: &Surfaces,
) {
    let mut materials = HashMap::new();
    for Surface {
        entity,
        lightmap: index,
        uv_rect,
    } in &loading.surfaces
    {
        let Ok((mesh, material, node)) = surfaces.surfaces.get(*entity) else {
            continue;
        };
        let Some(lightmap) = &lightmaps[*index] else {
            continue;
        };
        if let Some(problem) = stock.unlit(mesh) {
            let object = surfaces.names.get(node.parent()).map_or("", Name::as_str);
            loading
                .problems
                .extend((!problem.is_empty()).then(|| format!("Object '{object}': {problem}")));
            continue;
        }
        let image = lightmap.image.clone();
        let mut surface = commands.entity(*entity);
        surface.insert((
            Lightmap {
                image,
                uv_rect: *uv_rect,
                bicubic_sampling: stock.settings.bicubic,
            },
            Lightmapped {
                lightmap: loading.lightmaps[*index].name.clone(),
            },
        ));
        if let (Some(material), Some(maps)) = (material, &lightmap.directional)
            && let Some(base) = stock
                .standard
                .get(material)
                .filter(|base| base.normal_map_texture.is_some())
        {
            let corners =
                [uv_rect.min, uv_rect.max].map(|corner| corner.to_array().map(f32::to_bits));
            let made = materials
                .entry((material.id(), *index, corners))
                .or_insert_with(|| {
                    stock.directional.add(DirectionalMaterial {
                        base: base.clone(),
                        extension: maps.light(*uv_rect),
                    })
                });
            surface
                .remove::<MeshMaterial3d<StandardMaterial>>()
                .insert(MeshMaterial3d(made.clone()));
        }
    }
}

impl Stock<'_> {
    /// Returns why a mesh shows no lightmap: a message, or an empty text for loose edges; None if it does.
    fn unlit(&self, mesh: &Mesh3d) -> Option<&'static str> {
        let mesh = self.meshes.get(&mesh.0)?;
        // Without access to the vertices, which may be on the GPU only, the mesh is taken as complete.
        if mesh
            .try_contains_attribute(Mesh::ATTRIBUTE_UV_1)
            .unwrap_or(true)
        {
            return None;
        }
        let is_loose = mesh.primitive_topology() != PrimitiveTopology::TriangleList;
        Some(if is_loose {
            ""
        } else {
            "no second UV map, so no lightmap. Use Export for Engine."
        })
    }
}

/// Reports scenes whose light is drawn.
pub(crate) fn report_ready(
    mut commands: Commands,
    mut scenes: Query<(Entity, &mut MixedLightmaps), With<Drawing>>,
) {
    for (entity, mut mixed) in &mut scenes {
        if mixed.0.iter().all(MixedLightmap::is_drawn) {
            for lightmap in &mut mixed.bypass_change_detection().0 {
                lightmap.free_constant();
            }
            commands.entity(entity).remove::<Drawing>();
            commands.trigger(LightmapsReady { entity });
        }
    }
}

type Lit<'a, M> = (Ref<'a, Lightmapped>, Ref<'a, MeshMaterial3d<M>>);

/// Lets materials show baked light as it is stored.
pub(crate) fn set_exposure(
    settings: Res<HemibakeSettings>,
    standard: Query<Lit<StandardMaterial>>,
    directional: Query<Lit<DirectionalMaterial>>,
    mut standard_materials: ResMut<Assets<StandardMaterial>>,
    mut directional_materials: ResMut<Assets<DirectionalMaterial>>,
) {
    let is_changed = settings.is_changed();
    let luminance = settings.luminance();
    for material in changed(is_changed, &standard) {
        if standard_materials
            .get(&material)
            .is_some_and(|known| known.lightmap_exposure != luminance)
        {
            standard_materials
                .get_mut(&material)
                .expect("the material")
                .lightmap_exposure = luminance;
        }
    }
    for material in changed(is_changed, &directional) {
        if directional_materials
            .get(&material)
            .is_some_and(|known| known.base.lightmap_exposure != luminance)
        {
            directional_materials
                .get_mut(&material)
                .expect("the material")
                .base
                .lightmap_exposure = luminance;
        }
    }
}

/// Returns the materials of surfaces that are new or have other materials; of all surfaces if `all` is true.
fn changed<M: Material>(all: bool, surfaces: &Query<Lit<M>>) -> Vec<Handle<M>> {
    let chosen = surfaces
        .iter()
        .filter(|(lit, material)| all || lit.is_added() || material.is_changed());
    chosen.map(|(_, material)| material.0.clone()).collect()
}
