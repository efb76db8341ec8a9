//! Mixes the maps of a lightmap into one half-float texture, whenever the light changes.
//!
//! A render pass draws the decoded maps, one triangle each, with additive blending. It runs before the frame's other
//! passes, so a frame without a change of light costs nothing.

use std::{
    collections::HashMap,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use bevy::{
    app::{App, Plugin},
    asset::{AssetId, AssetServer, Handle, RenderAssetUsages, embedded_asset, load_embedded_asset},
    color::LinearRgba,
    core_pipeline::FullscreenShader,
    ecs::prelude::*,
    image::{Image, ImageSampler},
    math::{UVec2, Vec3},
    render::{
        Extract, ExtractSchedule, Render, RenderApp, RenderStartup, RenderSystems,
        render_asset::RenderAssets,
        render_resource::{
            BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BlendComponent,
            BlendFactor, BlendOperation, BlendState, CachedRenderPipelineId, ColorTargetState,
            ColorWrites, CommandEncoderDescriptor, Extent3d, FragmentState, LoadOp, Operations,
            PipelineCache, RenderPassColorAttachment, RenderPassDescriptor, RenderPipeline,
            RenderPipelineDescriptor, ShaderStages, ShaderType, StoreOp, TextureDimension,
            TextureFormat, TextureSampleType, TextureUsages, UniformBuffer,
            binding_types::{texture_2d, uniform_buffer},
        },
        renderer::{RenderDevice, RenderQueue},
        texture::GpuImage,
    },
    utils::default,
};

use crate::{light_control::LightControl, map_files::Decode};

/// Format of the mixed light: filterable and blendable also with WebGL 2 and on phones.
const TARGET: TextureFormat = TextureFormat::Rgba16Float;

/// Lightmaps of a scene whose maps are mixed.
#[derive(Component, Default)]
pub(crate) struct MixedLightmaps(pub Vec<MixedLightmap>);

/// A lightmap, and the maps whose sum it shows.
pub(crate) struct MixedLightmap {
    pub target: Handle<Image>,
    pub layers: Vec<MapLayer>,
    is_drawn: Arc<AtomicBool>,
}

/// A map of a light group, or of all light.
pub(crate) struct MapLayer {
    pub group: Option<String>,
    pub image: Handle<Image>,
    pub decode: Decode,
}

impl MixedLightmap {
    pub fn new(target: Handle<Image>, layers: Vec<MapLayer>) -> Self {
        Self {
            target,
            layers,
            is_drawn: Arc::default(),
        }
    }

    /// Returns true once the target holds light.
    pub fn is_drawn(&self) -> bool {
        self.is_drawn.load(Ordering::Relaxed)
    }

    /// Frees the maps of a lightmap without light groups, which never changes.
    pub fn free_constant(&mut self) {
        if self.layers.iter().all(|layer| layer.group.is_none()) {
            self.layers.clear();
        }
    }
}

/// Returns an image that receives mixed light.
pub(crate) fn target_image(size: UVec2) -> Image {
    let size = Extent3d {
        width: size.x,
        height: size.y,
        depth_or_array_layers: 1,
    };
    let mut image = Image::new_uninit(
        size,
        TextureDimension::D2,
        TARGET,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.texture_descriptor.usage =
        TextureUsages::TEXTURE_BINDING | TextureUsages::RENDER_ATTACHMENT;
    image.sampler = ImageSampler::linear();
    image
}

pub(crate) struct MixPlugin;

impl Plugin for MixPlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "mix.wgsl");
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            render_app
                .init_resource::<MixQueue>()
                .add_systems(RenderStartup, queue_pipeline)
                .add_systems(ExtractSchedule, extract_mixes)
                .add_systems(Render, draw_mixes.in_set(RenderSystems::PrepareResources));
        }
    }
}

/// Lightmaps to be drawn, by scene.
#[derive(Resource, Default)]
struct MixQueue(HashMap<Entity, Vec<Job>>);

struct Job {
    target: AssetId<Image>,
    layers: Vec<(AssetId<Image>, Layer)>,
    is_drawn: Arc<AtomicBool>,
}

/// Uniforms of `mix.wgsl`.
#[derive(Clone, Copy, ShaderType)]
struct Layer {
    weight: Vec3,
    intensity: f32,
    gamma: f32,
    decode: u32,
}

type LightChanged = Or<(Changed<MixedLightmaps>, Changed<LightControl>)>;

fn extract_mixes(
    mut queue: ResMut<MixQueue>,
    scenes: Extract<Query<(Entity, &MixedLightmaps, &LightControl), LightChanged>>,
    mut removed: Extract<RemovedComponents<MixedLightmaps>>,
) {
    for scene in removed.read() {
        queue.0.remove(&scene);
    }
    for (scene, mixed, light) in &scenes {
        let drawn = mixed
            .0
            .iter()
            .filter(|lightmap| !lightmap.layers.is_empty());
        queue
            .0
            .insert(scene, drawn.map(|lightmap| job(lightmap, light)).collect());
    }
}

fn job(lightmap: &MixedLightmap, light: &LightControl) -> Job {
    let layer = |map: &MapLayer| Layer {
        weight: map
            .group
            .as_ref()
            .map_or(Vec3::ONE, |group| light.factor(group)),
        intensity: map.decode.intensity,
        gamma: map.decode.gamma,
        decode: map.decode.kind as u32,
    };
    Job {
        target: lightmap.target.id(),
        layers: lightmap
            .layers
            .iter()
            .map(|map| (map.image.id(), layer(map)))
            .collect(),
        is_drawn: lightmap.is_drawn.clone(),
    }
}

#[derive(Resource)]
struct MixPipeline {
    layout: BindGroupLayoutDescriptor,
    id: CachedRenderPipelineId,
}

fn queue_pipeline(
    mut commands: Commands,
    shader: Res<FullscreenShader>,
    server: Res<AssetServer>,
    cache: Res<PipelineCache>,
) {
    let layout = BindGroupLayoutDescriptor::new(
        "hemibake_mix",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (
                uniform_buffer::<Layer>(false),
                texture_2d(TextureSampleType::Float { filterable: false }),
            ),
        ),
    );
    let sum = BlendComponent {
        src_factor: BlendFactor::One,
        dst_factor: BlendFactor::One,
        operation: BlendOperation::Add,
    };
    let id = cache.queue_render_pipeline(RenderPipelineDescriptor {
        label: Some("hemibake_mix".into()),
        layout: vec![layout.clone()],
        vertex: shader.to_vertex_state(),
        fragment: Some(FragmentState {
            shader: load_embedded_asset!(server.as_ref(), "mix.wgsl"),
            targets: vec![Some(ColorTargetState {
                format: TARGET,
                blend: Some(BlendState {
                    color: sum,
                    alpha: sum,
                }),
                write_mask: ColorWrites::ALL,
            })],
            ..default()
        }),
        ..default()
    });
    commands.insert_resource(MixPipeline { layout, id });
}

fn draw_mixes(
    mut queue: ResMut<MixQueue>,
    images: Res<RenderAssets<GpuImage>>,
    pipeline: Res<MixPipeline>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    commands: Res<RenderQueue>,
) {
    if queue.0.is_empty() {
        return;
    }
    let Some(program) = cache.get_render_pipeline(pipeline.id) else {
        return;
    };
    let painter = Painter {
        program,
        layout: &pipeline.layout,
        images: &images,
        cache: &cache,
        device: &device,
        commands: &commands,
    };
    queue.0.retain(|_, jobs| {
        jobs.retain(|job| !painter.draw(job));
        !jobs.is_empty()
    });
}

/// What a mix is drawn with.
struct Painter<'a> {
    program: &'a RenderPipeline,
    layout: &'a BindGroupLayoutDescriptor,
    images: &'a RenderAssets<GpuImage>,
    cache: &'a PipelineCache,
    device: &'a RenderDevice,
    commands: &'a RenderQueue,
}

impl Painter<'_> {
    /// Draws a lightmap; returns false if its textures are not on the GPU yet.
    fn draw(&self, job: &Job) -> bool {
        let Some(target) = self.images.get(job.target) else {
            return false;
        };
        let maps: Option<Vec<_>> = job
            .layers
            .iter()
            .map(|(image, layer)| Some((self.images.get(*image)?, *layer)))
            .collect();
        let Some(maps) = maps else { return false };
        let layout = self.cache.get_bind_group_layout(self.layout);
        let groups: Vec<_> = maps
            .into_iter()
            .map(|(map, layer)| {
                let mut uniforms = UniformBuffer::from(layer);
                uniforms.write_buffer(self.device, self.commands);
                let entries = BindGroupEntries::sequential((&uniforms, &map.texture_view));
                self.device
                    .create_bind_group("hemibake_mix", &layout, &entries)
            })
            .collect();
        let mut encoder = self
            .device
            .create_command_encoder(&CommandEncoderDescriptor {
                label: Some("hemibake_mix"),
            });
        let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("hemibake_mix"),
            color_attachments: &[Some(RenderPassColorAttachment {
                view: &target.texture_view,
                depth_slice: None,
                resolve_target: None,
                ops: Operations {
                    load: LoadOp::Clear(LinearRgba::NONE.into()),
                    store: StoreOp::Store,
                },
            })],
            ..default()
        });
        pass.set_pipeline(self.program);
        for group in &groups {
            pass.set_bind_group(0, group, &[]);
            pass.draw(0..3, 0..1);
        }
        drop(pass);
        self.commands.submit([encoder.finish()]);
        job.is_drawn.store(true, Ordering::Relaxed);
        true
    }
}
