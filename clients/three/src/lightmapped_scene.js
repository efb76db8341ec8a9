// A loaded scene whose light changes between states.

import { LightControl } from 'hemibake-manifest';

export class LightmappedScene extends LightControl {
  constructor(gltf, lightmaps, states, problems) {
    super(lightmaps, states, problems);
    this.gltf = gltf;
    this.scene = gltf.scene;
  }
}
