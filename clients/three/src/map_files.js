// Loads lightmap files: OpenEXR, Radiance HDR, KTX2, and PNG with RGBM, RGBD, LogLuv or sRGB.

import { ImageBitmapLoader, LinearFilter, NoColorSpace, Texture } from 'three';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
import { HDRLoader } from 'three/addons/loaders/HDRLoader.js';
import { KTX2Loader } from 'three/addons/loaders/KTX2Loader.js';
import { decoder, fileUrl } from 'hemibake-manifest';

/** Files of a folder, each loaded once. */
export class MapFiles {
  #loaded = new Map();

  constructor(renderer, base, problems) {
    this.renderer = renderer;
    this.base = base;
    this.problems = problems;
  }

  /** Returns { texture, levels, decode, intensity } of a map; null, and a message, if it cannot be read. */
  load(map) {
    if (!this.#loaded.has(map.file)) this.#loaded.set(map.file, this.#read(map));
    return this.#loaded.get(map.file);
  }

  async #read({ file, entry }) {
    const url = this.base + fileUrl(file);
    try {
      const texture = await this.#texture(url, entry.format);
      Object.assign(texture, { channel: 1, colorSpace: NoColorSpace, generateMipmaps: false });
      texture.minFilter = texture.magFilter = LinearFilter;
      texture.needsUpdate = true;
      const levels = Math.max(1, texture.mipmaps.length);
      return { texture, levels, decode: decoder(entry), intensity: entry.intensity };
    } catch (error) {
      this.problems.push(`${file}: not readable (${error.message ?? error}). Put it beside the glTF file, or export again.`);
      return null;
    }
  }

  async #texture(url, format) {
    switch (format) {
      case 'exr': return fromBottom(await new EXRLoader().loadAsync(url));
      case 'hdr': return fromTop(await new HDRLoader().loadAsync(url));
      case 'ktx2': return new KTX2Loader().detectSupport(this.renderer).loadAsync(url);
    }
    const loader = new ImageBitmapLoader().setOptions({ premultiplyAlpha: 'none', colorSpaceConversion: 'none' });
    return fromTop(new Texture(await loader.loadAsync(url)));
  }
}

// v of glTF is 0 at the top row, which EXRLoader puts last, and the other loaders first.
function fromBottom(texture) {
  texture.flipY = true;
  return texture;
}

function fromTop(texture) {
  texture.flipY = false;
  return texture;
}
