//! Loads map files: OpenEXR, Radiance HDR, KTX2, and PNG with RGBM, RGBD, LogLuv or sRGB.

use bevy::{
    asset::{AssetPath, RenderAssetUsages, prelude::*},
    image::{Image, ImageLoaderSettings, ImageSampler},
    render::render_resource::TextureFormat,
};

use crate::manifest::{Entry, MapFile};

/// Formula from a texel to light, irradiance / π.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Decode {
    pub kind: DecodeKind,
    pub intensity: f32,
    pub gamma: f32,
}

/// Kinds of formulas, numbered as in `mix.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum DecodeKind {
    Linear = 0,
    Srgb = 1,
    Rgbm = 2,
    Rgbd = 3,
    LogLuv = 4,
    /// Linear values that the texture unit has decoded as sRGB.
    FromSrgbTexture = 5,
    /// Signed values of a directional map.
    Signed = 6,
}

/// End of the formula of signed values.
const SIGNED: &str = "(2.0 * rgb - 1.0)";

impl Decode {
    /// Light that an image holds as it is, except for a factor.
    pub fn linear(intensity: f32) -> Self {
        Self {
            kind: DecodeKind::Linear,
            intensity,
            gamma: 1.0,
        }
    }

    /// Formula of a file of the manifest; a message for other formats.
    pub fn of(entry: &Entry) -> Result<Self, String> {
        let kind = match entry.format.as_str() {
            "exr" | "hdr" | "ktx2" => return Ok(Self::linear(1.0)),
            "png"
                if entry
                    .decode_texel
                    .as_ref()
                    .is_some_and(|formula| formula.ends_with(SIGNED)) =>
            {
                DecodeKind::Signed
            }
            "png" => DecodeKind::Srgb,
            "rgbm" => DecodeKind::Rgbm,
            "rgbd" => DecodeKind::Rgbd,
            "logluv" => DecodeKind::LogLuv,
            other => return Err(format!("bevy_hemibake does not read the format {other}")),
        };
        Ok(Self {
            kind,
            intensity: entry.intensity.unwrap_or(1.0),
            gamma: entry.gamma.unwrap_or(1.0),
        })
    }
}

/// A map that is being loaded.
#[derive(Debug)]
pub(crate) struct PendingMap {
    /// File name for messages.
    pub file: String,
    pub image: Handle<Image>,
    pub decode: Decode,
    /// False for a texture of the glTF file, which is loaded with it and may have other users.
    is_own: bool,
    pub state: MapState,
}

/// State of a map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum MapState {
    Loading,
    Loaded,
    /// Reason.
    Failed(String),
}

impl PendingMap {
    /// Starts to load a file in a folder.
    pub fn load(server: &AssetServer, folder: &AssetPath<'static>, map: &MapFile) -> Self {
        let file = map.file.clone();
        let path = AssetPath::from_path_buf(folder.path().join(&file))
            .with_source(folder.source().clone_owned());
        match Decode::of(&map.entry) {
            Ok(decode) => {
                let image = match decode.kind {
                    DecodeKind::Linear => server.load(path),
                    _ => server.load_with_settings(path, |settings: &mut ImageLoaderSettings| {
                        settings.is_srgb = false
                    }),
                };
                Self {
                    file,
                    image,
                    decode,
                    is_own: true,
                    state: MapState::Loading,
                }
            }
            Err(reason) => {
                let (image, decode) = (Handle::default(), Decode::linear(1.0));
                Self {
                    file,
                    image,
                    decode,
                    is_own: true,
                    state: MapState::Failed(reason),
                }
            }
        }
    }

    /// Takes a texture of the glTF file; None if it was not readable.
    pub fn inside(name: &str, texture: Option<(Handle<Image>, f32)>) -> Self {
        let reason = "Bevy has not loaded the texture".into();
        let state = if texture.is_some() {
            MapState::Loading
        } else {
            MapState::Failed(reason)
        };
        let (image, intensity) = texture.unwrap_or_default();
        Self {
            file: name.into(),
            image,
            decode: Decode::linear(intensity),
            is_own: false,
            state,
        }
    }

    /// Updates the state. An image of a file gets a linear sampler, and a format that all devices can read.
    ///
    /// Call it in each frame, before the render world extracts the image.
    pub fn poll(&mut self, server: &AssetServer, images: &mut Assets<Image>) {
        if self.state != MapState::Loading {
            return;
        }
        if let Some(bevy::asset::LoadState::Failed(error)) = server.get_load_state(&self.image) {
            self.state = MapState::Failed(error.to_string());
            return;
        }
        let Some(image) = images.get_mut_untracked(&self.image) else {
            return;
        };
        if self.is_own {
            prepare(image);
        } else if image.texture_descriptor.format.is_srgb() {
            self.decode.kind = DecodeKind::FromSrgbTexture;
        }
        self.state = MapState::Loaded;
    }
}

/// Gives an image a linear sampler, and floats instead of 16-bit integers. Its texels are kept on the GPU only.
fn prepare(image: &mut Image) {
    image.sampler = ImageSampler::linear();
    if image.texture_descriptor.format == TextureFormat::Rgba16Unorm
        && let Some(texels) = &image.data
    {
        let values = texels
            .chunks_exact(2)
            .map(|pair| f32::from(u16::from_ne_bytes([pair[0], pair[1]])) / 65535.0);
        image.data = Some(values.flat_map(f32::to_ne_bytes).collect());
        image.texture_descriptor.format = TextureFormat::Rgba32Float;
    }
    image.asset_usage = RenderAssetUsages::RENDER_WORLD;
}

#[cfg(test)]
mod tests {
    use bevy::render::render_resource::{Extent3d, TextureDimension};

    use super::*;

    fn entry(format: &str) -> Entry {
        Entry {
            format: format.into(),
            intensity: Some(34.5),
            gamma: Some(2.2),
            ..Entry::default()
        }
    }

    #[test]
    fn formats_with_floats_hold_light_as_it_is() {
        for format in ["exr", "hdr", "ktx2"] {
            assert_eq!(Decode::of(&entry(format)), Ok(Decode::linear(1.0)));
        }
    }

    #[test]
    fn encoded_formats_have_intensity_and_gamma() {
        let wanted = Decode {
            kind: DecodeKind::Rgbm,
            intensity: 34.5,
            gamma: 2.2,
        };
        assert_eq!(Decode::of(&entry("rgbm")), Ok(wanted));
        assert_eq!(Decode::of(&entry("png")).unwrap().kind, DecodeKind::Srgb);
        let formula = Some("light = intensity * (2.0 * rgb - 1.0)".into());
        let signed = Entry {
            decode_texel: formula,
            ..entry("png")
        };
        assert_eq!(Decode::of(&signed).unwrap().kind, DecodeKind::Signed);
        let error = Decode::of(&entry("jxl")).unwrap_err();
        assert_eq!(error, "bevy_hemibake does not read the format jxl");
    }

    #[test]
    fn sixteen_bits_become_floats() {
        let size = Extent3d {
            width: 1,
            height: 1,
            depth_or_array_layers: 1,
        };
        let texel = [0u16, 65535, 13107, 65535]
            .into_iter()
            .flat_map(u16::to_ne_bytes)
            .collect();
        let mut image = Image::new(
            size,
            TextureDimension::D2,
            texel,
            TextureFormat::Rgba16Unorm,
            RenderAssetUsages::default(),
        );
        prepare(&mut image);
        assert_eq!(image.texture_descriptor.format, TextureFormat::Rgba32Float);
        let wanted: Vec<_> = [0.0f32, 1.0, 0.2, 1.0]
            .into_iter()
            .flat_map(f32::to_ne_bytes)
            .collect();
        assert_eq!(image.data, Some(wanted));
    }
}
