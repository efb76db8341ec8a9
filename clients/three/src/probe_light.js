// Light of a probe volume: of all light, or a mix of light groups, in the texture of a grid of three.js.

import { Data3DTexture, DataUtils, HalfFloatType, LinearFilter, RGBAFormat } from 'three';

/** Volumes of RGBA in the texture; together they hold the 27 numbers of a probe and a 0. */
const VOLUMES = 7;

const WHITE = [1, 1, 1];

export class ProbeLight {
  #all; #groups; #shown; #texture; #resolution;

  /**
   * resolution:  probes along the axes of three.js
   * all:         light of all groups, Float32Array of 27 numbers a probe: RGB of 9 coefficients, x fastest
   * groups:      Map of the light of light groups
   */
  constructor([nx, ny, nz], all, groups) {
    this.#resolution = [nx, ny, nz];
    this.#all = all;
    this.#groups = groups;
    this.#shown = { factors: null, intensity: 1 };
    const texture = new Data3DTexture(new Uint16Array(4 * nx * ny * VOLUMES * (nz + 2)), nx, ny, VOLUMES * (nz + 2));
    this.#texture = Object.assign(texture, {
      format: RGBAFormat, type: HalfFloatType, minFilter: LinearFilter, magFilter: LinearFilter,
    });
    this.#write();
  }

  get groups() { return [...this.#groups.keys()]; }

  get texture() { return this.#texture; }

  /** Factor of all light. */
  get intensity() { return this.#shown.intensity; }

  set intensity(intensity) {
    if (intensity === this.#shown.intensity) return;
    this.#shown.intensity = intensity;
    this.#write();
  }

  /** Mixes the light groups by their factors, a Map of RGB by group. */
  mix(factors) {
    if (this.#groups.size === 0) return;
    this.#shown.factors = new Map(factors);
    this.#write();
  }

  dispose() {
    this.#texture.dispose();
  }

  // Each volume has a copy of its first and last slice, since the filter reads across them.
  #write() {
    const [nx, ny, nz] = this.#resolution, layer = 4 * nx * ny, { data } = this.#texture.image, light = this.#light();
    for (let z = -1; z <= nz; z++) {
      const slice = 27 * nx * ny * Math.min(Math.max(z, 0), nz - 1);
      for (let i = 0; i < nx * ny; i++) {
        for (let n = 0; n < 27; n++) {
          const place = (Math.floor(n / 4) * (nz + 2) + z + 1) * layer + 4 * i + n % 4;
          data[place] = DataUtils.toHalfFloat(light[slice + 27 * i + n]);
        }
      }
    }
    this.#texture.needsUpdate = true;
  }

  #light() {
    const { factors, intensity } = this.#shown, sum = new Float32Array(this.#all.length);
    const parts = factors === null ? [[WHITE, this.#all]]
      : [...this.#groups].map(([name, light]) => [factors.get(name) ?? WHITE, light]);
    for (const [factor, light] of parts) {
      for (let i = 0; i < sum.length; i++) sum[i] += intensity * factor[i % 3] * light[i];
    }
    return sum;
  }
}
