// Light of a loaded scene: states and single groups, mixed into its lightmaps.

import { LightMix } from './light_mix.js';

export class LightControl {
  #mix; #lightmaps; #frame = 0; #ended = () => {};

  /**
   * lightmaps:  objects with `groups`, names, `mix(factors)` and `dispose()`
   * states:     factors by state and group
   * problems:   messages, to which those on states are added
   * others:     names of light groups of other files, which states may name too
   */
  constructor(lightmaps, states, problems, others = []) {
    this.#lightmaps = [...lightmaps];
    this.#mix = new LightMix(new Set(lightmaps.flatMap(lightmap => lightmap.groups)), states, others);
    this.problems = [...problems, ...this.#mix.problems];
    for (const problem of this.problems) console.warn(problem);
  }

  /** Names of the light groups. */
  get groups() { return [...this.#mix.factors.keys()]; }

  /** Names of the light states. */
  get states() { return Object.keys(this.#mix.states); }

  /** Changes to a light state; resolves when the fade is over or another change replaces it. Throws if unknown. */
  async setState(name, { seconds = 0 } = {}) {
    this.#stop();
    this.#mix.setState(name, seconds, performance.now() / 1000);
    this.#draw();
    if (seconds > 0) await new Promise(resolve => { this.#ended = resolve; this.#fade(); });
  }

  /** Sets color, { r, g, b } or [r, g, b], linear, and strength of a light group. Throws if unknown. */
  setGroup(name, color, strength = 1) {
    this.#stop();
    this.#mix.setGroup(name, color, strength);
    this.#draw();
  }

  /** Lets states and groups change another part too: an object like the lightmaps, such as probe grids. */
  add(part) {
    this.#lightmaps.push(part);
    this.#mix.addGroups(part.groups);
    this.#draw();
  }

  /** Frees the textures of the lightmaps. */
  dispose() {
    this.#stop();
    for (const lightmap of this.#lightmaps) lightmap.dispose();
  }

  #stop() {
    cancelAnimationFrame(this.#frame);
    this.#ended();
  }

  #fade() {
    this.#frame = requestAnimationFrame(() => {
      const isFading = this.#mix.advance(performance.now() / 1000);
      this.#draw();
      if (isFading) this.#fade();
      else this.#ended();
    });
  }

  #draw() {
    for (const lightmap of this.#lightmaps) lightmap.mix(this.#mix.factors);
  }
}
