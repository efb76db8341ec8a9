// A .glb file and the lightmaps in it, for engines that do not read MOZ_lightmap and MOZ_texture_rgbe.

const GLTF = 0x46546c67, JSON_CHUNK = 0x4e4f534a, BINARY_CHUNK = 0x004e4942;

/** PNG of one white pixel, which stands for images that glTF does not define. */
const PIXEL = 'data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8BQDwAEhQGAhKmMIQAAAABJRU5ErkJggg==';

const LINEAR = 'light = intensity * rgb';

export class Glb {
  /** Reads a .glb file, an ArrayBuffer; throws an Error if it is none. */
  constructor(buffer) {
    const view = new DataView(buffer);
    if (buffer.byteLength < 20 || view.getUint32(0, true) !== GLTF) throw new Error('no .glb file');
    for (let at = 12; at < buffer.byteLength;) {
      const length = view.getUint32(at, true), bytes = new Uint8Array(buffer, at + 8, length);
      const kind = view.getUint32(at + 4, true);
      if (kind === JSON_CHUNK) this.json = JSON.parse(new TextDecoder().decode(bytes));
      if (kind === BINARY_CHUNK) this.binary = bytes;
      at += 8 + length;
    }
  }

  /**
   * Returns the lightmaps by the index of each material: a Map of { name, light, groups }.
   *
   * A map is { bytes, mime, decode, intensity }; texels of `bytes` are decoded to E / pi.
   */
  lightmaps() {
    const found = new Map();
    for (const [index, material] of (this.json.materials ?? []).entries()) {
      const known = material.extensions?.MOZ_lightmap;
      if (known === undefined) continue;
      const groups = Object.entries(known.extras?.hemibake?.groups ?? {});
      found.set(index, {
        name: this.json.textures[known.index].name,
        light: this.#map(known),
        groups: new Map(groups.map(([name, group]) => [name, this.#map(group)])),
      });
    }
    return found;
  }

  /** Returns the file as a Blob in which one pixel replaces each image in Radiance HDR. */
  plain() {
    const json = structuredClone(this.json);
    for (const image of json.images ?? []) {
      if (image.mimeType !== 'image/vnd.radiance') continue;
      Object.assign(image, { bufferView: undefined, mimeType: 'image/png', uri: PIXEL });
    }
    for (const texture of json.textures ?? []) texture.source ??= texture.extensions?.MOZ_texture_rgbe?.source;
    const text = new TextEncoder().encode(JSON.stringify(json)), padding = -text.length & 3;
    const chunks = [[JSON_CHUNK, [text, new Uint8Array(padding).fill(32)], text.length + padding]];
    if (this.binary) chunks.push([BINARY_CHUNK, [this.binary], this.binary.length]);
    const total = chunks.reduce((sum, [, , length]) => sum + 8 + length, 12);
    const parts = chunks.flatMap(([kind, data, length]) => [new Uint32Array([length, kind]), ...data]);
    return new Blob([new Uint32Array([GLTF, 2, total]), ...parts], { type: 'model/gltf-binary' });
  }

  #map({ index, intensity }) {
    const texture = this.json.textures[index];
    const image = this.json.images[texture.extensions?.MOZ_texture_rgbe?.source ?? texture.source];
    const { byteOffset = 0, byteLength } = this.json.bufferViews[image.bufferView];
    const bytes = this.binary.subarray(byteOffset, byteOffset + byteLength);
    return { bytes, mime: image.mimeType, decode: LINEAR, intensity: intensity / Math.PI };
  }
}
